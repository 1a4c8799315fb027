// The dialogs in which a researcher corrects, adds a note, erases words, and records a withdrawal.

import { get, post, Refused } from "../shared/api.js";
import { askIn, askReason, isAsking } from "../shared/dialogs.js";
import { byId, make, setText } from "../shared/dom.js";
import { answerName, correctable, hint, read, soFar, written } from "./correction_words.js";
import { voicePlayer } from "./voice.js";

/**
 * @typedef {object} Asked
 * @property {string} heading
 * @property {string} consequence
 * @property {{ label: string, options: { value: string, text: string }[] }} [which] a list to choose from
 * @property {{ label: string, value: string, hint: string }} [text] a field to write in
 * @property {string} [reason] the initial text of the field for the reason
 * @property {HTMLElement} [player] plays the recording to transcribe
 * @property {(which: string) => void} [chosen] called when an option of the list is chosen
 * @property {(answer: { which: string, text: string, reason: string }) => Promise<void>} done
 */

/** @param {Asked} asked */
function ask({ heading, consequence, which, text, reason: usual = "", player, chosen, done }) {
  if (isAsking()) return;
  setText(byId("correct-heading"), heading);
  setText(byId("correct-consequence"), consequence);
  // The player is removed when the dialog closes, which also stops its sound.
  byId("correct-so-far").replaceChildren(...(player ? [player] : []));
  byId("correct-dialog").addEventListener("close", () => player?.remove(), { once: true });

  const list = byId("correct-which", HTMLSelectElement);
  byId("correct-which-field").hidden = !which;
  setText(byId("correct-which-label"), which?.label ?? "");
  list.replaceChildren(
    ...(which?.options ?? []).map(({ value, text: name }) => make("option", { value }, name)),
  );
  list.onchange = () => chosen?.(list.value);

  const field = byId("correct-new", HTMLTextAreaElement);
  byId("correct-new-field").hidden = !text;
  setText(byId("correct-new-label"), text?.label ?? "");
  setText(byId("correct-hint"), text?.hint ?? "");
  field.value = text?.value ?? "";

  const reason = byId("correct-reason", HTMLInputElement);
  reason.value = usual;
  chosen?.(list.value);
  askIn(byId("correct-dialog", HTMLDialogElement), byId("correct-trouble"), () =>
    done({ which: list.value, text: field.value.trim(), reason: reason.value.trim() }),
  );
}

/**
 * Records a correction, and reloads the page.
 *
 * @param {string} session
 * @param {Api.NewCorrection} correction
 */
async function record(session, correction) {
  await post("/api/researcher/sessions/{session}/corrections", correction, { session });
  location.reload();
}

/**
 * Asks for the correct participant of the session.
 *
 * @param {string} session
 * @param {string} old
 * @param {string[]} participants
 */
export function correctParticipant(session, old, participants) {
  const others = participants.filter((code) => code !== old);
  ask({
    heading: "Correct the participant",
    consequence:
      `The session keeps the recorded code ${old}. ` +
      "The correct code is shown beside it, here and in exports.",
    which: { label: "Right participant", options: others.map((code) => ({ value: code, text: code })) },
    done: ({ which, reason }) => record(session, { field: "participant", old, new: which, reason }),
  });
}

/**
 * Asks for the correct answer to a question.
 *
 * @param {string} session
 */
export async function correctAnswer(session) {
  const detail = await get("/api/researcher/sessions/{session}", { session });
  const answers = correctable(detail.answers);
  const find = (/** @type {string} */ key) => answers.find((answer) => answer.key === key);

  ask({
    heading: "Correct an answer",
    consequence:
      "The surgeon’s answer stays as it was given. " +
      "The correct one is shown beside it, and scores use the correct one.",
    which: {
      label: "Answer",
      options: answers.map((answer) => ({ value: answer.key, text: answerName(answer) })),
    },
    text: { label: "Right answer", value: "", hint: "" },
    chosen: (key) => {
      const answer = find(key);
      if (!answer) return;
      setText(byId("correct-so-far"), `So far: ${answer.corrected_words ?? answer.words}`);
      setText(byId("correct-hint"), hint(answer.kind));
      byId("correct-new", HTMLTextAreaElement).value = written(soFar(answer));
    },
    done: ({ which, text, reason }) => {
      const answer = find(which);
      const value = answer && read(answer.kind, text);
      if (!answer || value == null)
        throw new Refused(422, `This is not a valid answer. ${hint(answer?.kind)}`, true);
      return record(session, { field: "value", record: which, old: soFar(answer), new: value, reason });
    },
  });
}

/**
 * Asks for a note on a comment or an answer.
 *
 * @param {string} session
 * @param {string} key
 * @param {string} old
 */
export function askNote(session, key, old) {
  ask({
    heading: old ? "Change the note" : "Add a note",
    consequence: "The surgeon’s words stay as they are. The note is shown beside them, here and in exports.",
    text: { label: "Note", value: old, hint: "" },
    done: ({ text, reason }) => record(session, { field: "note", record: key, old, new: text, reason }),
  });
}

/**
 * Asks for the transcript of a voice comment.
 *
 * @param {string} session
 * @param {Api.TimelineComment} comment
 */
export function askTranscript(session, comment) {
  const { key } = comment;
  const old = comment.note ?? "";
  ask({
    heading: old ? "Change the transcript" : "Transcribe the comment",
    consequence:
      "The recording stays as it is. " +
      "What you type is shown beside it, here and in exports, with who typed it and when.",
    text: { label: "What was said", value: old, hint: "" },
    reason: old ? "" : "Typed out from the recording",
    player: voicePlayer(session, comment) ?? undefined,
    done: ({ text, reason }) => record(session, { field: "note", record: key, old, new: text, reason }),
  });
}

/**
 * Asks whether to erase words.
 *
 * @param {string} session
 * @param {"comment" | "answer"} subject
 * @param {string} key
 */
export function askErasure(session, subject, key) {
  askReason({
    heading: "Erase these words",
    consequence:
      "The words are permanently deleted from the database, with every note on them. Earlier backups and exports " +
      "still hold them. The record stays, and says that its words were erased, by whom and why. " +
      "Do not repeat the words here.",
    go: "Erase permanently",
    danger: true,
    done: (reason) => erase(session, { subject, record: key, reason }),
  });
}

/**
 * Asks whether to erase all words of a withdrawn session.
 *
 * @param {string} session
 */
export function askErasureOfAll(session) {
  askReason({
    heading: "Erase all words of this session",
    consequence:
      "All comments with their sound, all answers in words and all notes are permanently deleted from the database. " +
      "Earlier backups and exports still hold them. " +
      "The records stay, and say that their words were erased, by whom and why.",
    go: "Erase all permanently",
    danger: true,
    done: async (reason) => {
      await post("/api/researcher/sessions/{session}/erasures/all", { reason }, { session });
      location.reload();
    },
  });
}

/**
 * Asks whether to erase the reason of an event.
 *
 * @param {string} session
 * @param {string} number the event's number
 */
export function askErasureOfReason(session, number) {
  askReason({
    heading: "Erase this reason",
    consequence:
      "The reason is permanently deleted from the database, also where the study’s audit trail repeats it. Earlier " +
      "backups and exports still hold it. The event stays, and the audit trail says that its words were erased, " +
      "by whom and why. Do not repeat the words here.",
    go: "Erase permanently",
    danger: true,
    done: (reason) => erase(session, { subject: "event", record: number, reason }),
  });
}

/**
 * Erases words, and reloads the page.
 *
 * @param {string} session
 * @param {Api.NewErasure} erasure
 */
async function erase(session, erasure) {
  await post("/api/researcher/sessions/{session}/erasures", erasure, { session });
  location.reload();
}

/**
 * Asks whether the participant withdraws.
 *
 * @param {string} session
 */
export function askWithdrawal(session) {
  askReason({
    heading: "The participant withdraws",
    consequence:
      "From now on this session’s data are not shown, analysed or exported. " +
      "The record keeps that it was withdrawn. This cannot be undone. Afterwards its words can be erased as well.",
    go: "Withdraw session",
    danger: true,
    done: async (reason) => {
      await post("/api/researcher/sessions/{session}/withdraw", { reason }, { session });
      location.reload();
    },
  });
}
