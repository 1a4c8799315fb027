// A researcher's actions on a session: correct, add notes, erase words, record a withdrawal, unblind.

import { get, inWords, post } from "../shared/api.js";
import { askConfirmed, askReason } from "../shared/dialogs.js";
import { byId, setText } from "../shared/dom.js";
import { timeIn } from "../shared/text.js";
import "../shared/sign_in.js";
import {
  askErasure,
  askErasureOfAll,
  askErasureOfReason,
  askNote,
  askWithdrawal,
  correctAnswer,
  correctParticipant,
} from "./corrections.js";
import { outstandingWords } from "./timeline_words.js";

const page = byId("session").dataset;
const session = page.session ?? "";
const ended = page.ended === "true";
/** Empty if the session is outside any study. */
const study = page.study ?? "";

/** @param {string} moment */
function timeOfDay(moment) {
  return timeIn(moment, byId("zone").textContent ?? "");
}

/** Says what a surgeon's tablet may still hold; null if nothing is outstanding, or if the server does not answer. */
async function outstandingNow() {
  try {
    const { outstanding } = await get("/api/researcher/sessions/{session}", { session });
    return outstandingWords(outstanding, timeOfDay);
  } catch {
    // The server checks this again before it unblinds.
    return null;
  }
}

async function unblind() {
  const open = await outstandingNow();
  const late = open
    ? ` ${open} What arrives after unblinding is kept and marked late, but does not count.`
    : "";
  const usual =
    "You and everyone with this page will see which policy ran in which setting. This cannot be undone. " +
    `The audit trail and every export will say so.${late}`;
  const emergency =
    "The session is still under way. Unblinding now is an emergency measure. The audit trail and every " +
    "export will always say so. The surgeon’s and operator’s pages still do not show the policies.";

  const ofStudy =
    `This session belongs to study ${study}, which stays blinded. Unblinding a single session is an emergency ` +
    `measure. Every export says who did it and why, so do not name a policy in the reason.${late}`;

  const isEmergency = !ended || study !== "";
  const asked = {
    heading: isEmergency ? "Emergency unblinding" : "Unblind this session",
    consequence: study ? ofStudy : ended ? usual : emergency,
    confirm: open ? "Unblind anyway, although a tablet may still hold comments or answers" : undefined,
    go: isEmergency ? "Unblind now" : "Unblind",
    danger: true,
  };

  /**
   * @param {string} reason
   * @param {string} [passphrase] asked for once more
   */
  async function done(reason, passphrase) {
    const path = "/api/researcher/sessions/{session}/unblind";
    await post(path, { reason, passphrase, despite_outstanding: open !== null }, { session });
    location.reload();
  }

  if (study) askConfirmed({ ...asked, done });
  else askReason({ ...asked, done: (reason) => done(reason) });
}

// Each of these buttons exists only if the session allows it.
document.getElementById("unblind")?.addEventListener("click", unblind);
document.getElementById("withdraw")?.addEventListener("click", () => askWithdrawal(session));
document.getElementById("erase-all")?.addEventListener("click", () => askErasureOfAll(session));
document.getElementById("correct-participant")?.addEventListener("click", () => {
  correctParticipant(session, page.participant ?? "", (page.participants ?? "").split(" ").filter(Boolean));
});
document.getElementById("correct-answer")?.addEventListener("click", async () => {
  try {
    await correctAnswer(session);
  } catch (error) {
    setText(byId("corrections-trouble"), inWords(error));
  }
});
for (const button of document.querySelectorAll(
  "button[data-note], button[data-erase], button[data-erase-reason]",
)) {
  if (!(button instanceof HTMLButtonElement)) continue;
  const { note, noted, erase, eraseReason } = button.dataset;
  button.onclick = () => {
    if (note) askNote(session, note, noted ?? "");
    if (erase) askErasure(session, "answer", erase);
    if (eraseReason) askErasureOfReason(session, eraseReason);
  };
}
