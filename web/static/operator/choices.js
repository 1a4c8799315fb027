// The lists to choose from when a session is prepared (participants, protocols, studies), and the list of policies.

import { get, post } from "../shared/api.js";
import { askIn } from "../shared/dialogs.js";
import { byId, make, setText } from "../shared/dom.js";
import { tell, tellTrouble } from "../shared/trouble.js";
import { BY_HAND, UNTOLD } from "./focus_card.js";
import { asCode, practiceFirst, protocolWords } from "./session_words.js";

/** @typedef {{ value: string, label: string, disabled?: boolean, hidden?: boolean }} Option */

const participants = byId("participant", HTMLSelectElement);
const protocols = byId("protocol", HTMLSelectElement);
const policies = byId("policy", HTMLSelectElement);
const studies = byId("study", HTMLSelectElement);

/** The value in the list of studies for a session outside any study. */
const OUTSIDE = "outside";

/** Nothing is chosen beforehand: a wrong participant or protocol must not be one tap away. */
const CHOOSE = { value: "", label: "Choose…" };

/** @type {Api.Choices | null} */
let choices = null;

/**
 * @param {HTMLSelectElement} list
 * @param {Option[]} options
 * @param {string} chosen
 */
function fill(list, options, chosen) {
  list.replaceChildren(
    ...options.map(({ value, label, disabled = false, hidden = false }) =>
      make("option", { value, disabled, hidden, selected: value === chosen }, label),
    ),
  );
}

/**
 * @param {Api.Choices} now
 * @param {string} participant
 */
function draw(now, participant) {
  const codes = now.participants.map((code) => ({ value: code, label: code }));
  fill(participants, [CHOOSE, ...codes], participant);
  drawStudies(now);
  drawProtocols(now);
  const fixed = [
    { value: UNTOLD, label: "Hidden during a session", hidden: true },
    { value: BY_HAND, label: "By hand" },
  ];
  const named = now.policies.map(({ name, available }) => ({
    value: name,
    label: available ? name : `${name} (weights missing)`,
    disabled: !available,
  }));
  fill(policies, [...fixed, ...named], policies.value);
  drawSummary();
}

/**
 * Hides the list of studies if none is open. If one is open, nothing is selected beforehand: a session that was meant
 * for the study must not end up outside it.
 *
 * @param {Api.Choices} now
 */
function drawStudies(now) {
  const open = now.studies.flatMap(({ study, title, sites }) =>
    sites.map((site) => ({ value: `${study}/${site}`, label: `${title} (${study}), ${site}` })),
  );
  byId("study-choice").hidden = open.length === 0;
  studies.required = open.length > 0;
  fill(studies, [CHOOSE, ...open, { value: OUTSIDE, label: "Outside any study" }], studies.value);
}

/** The chosen study and site; undefined if none is chosen. */
function chosenStudy() {
  const [study = "", site = ""] = studies.value.split("/");
  return site ? { study, site } : undefined;
}

/**
 * The protocols that can be chosen. In a study these are the ones of its plan.
 *
 * @param {Api.Choices} now
 */
function offeredProtocols(now) {
  const chosen = chosenStudy();
  const study = now.studies.find((open) => open.study === chosen?.study);
  return study ? study.protocols : now.protocols;
}

/** @param {Api.Choices} now */
function drawProtocols(now) {
  const offered = practiceFirst(offeredProtocols(now));
  const named = offered.map(({ name, researcher_title: label }) => ({ value: name, label }));
  fill(protocols, [CHOOSE, ...named], protocols.value);
}

function drawSummary() {
  // The summary includes the title, because the list cuts off long titles.
  const offered = choices ? offeredProtocols(choices) : [];
  const protocol = offered.find(({ name }) => name === protocols.value);
  setText(byId("protocol-summary"), protocol ? protocolWords(protocol) : "");
}

/**
 * Keeps the lists up to date with the server. Calls `drawn` after the lists were redrawn, and `prepare` with the answer
 * when a session is prepared. Returns functions that ask the server again, and that forget what was chosen.
 *
 * @param {() => void} drawn
 * @param {(answer: Promise<Api.OperatorView | null>) => Promise<void>} prepare
 */
export function followChoices(drawn, prepare) {
  async function refresh() {
    const before = choices;
    try {
      const now = await get("/api/operator/choices");
      // Redraws a list, which may be open, only if something changed, and never from an answer older than a participant
      // that was added here.
      if (choices !== before || JSON.stringify(now) === JSON.stringify(choices)) return;
      choices = now;
      draw(now, participants.value);
      drawn();
    } catch (error) {
      tellTrouble(byId("session-trouble"), error);
    }
  }

  async function add() {
    const code = byId("code", HTMLInputElement).value.trim();
    const codes = await post("/api/operator/participants", { code });
    // The lists may not have come yet. An answer that is older than the participant would not have it to choose.
    choices = { ...(choices ?? (await get("/api/operator/choices"))), participants: codes };
    draw(choices, code);
    drawn();
  }

  studies.addEventListener("change", () => {
    if (choices) drawProtocols(choices);
    drawSummary();
  });
  protocols.addEventListener("change", drawSummary);
  byId("new-session", HTMLFormElement).addEventListener("submit", async (event) => {
    event.preventDefault();
    const go = event.submitter;
    if (go instanceof HTMLButtonElement) go.disabled = true;
    try {
      const wanted = {
        participant: participants.value,
        protocol: protocols.value,
        study: chosenStudy(),
      };
      await prepare(post("/api/operator/sessions", wanted));
      tell(byId("session-trouble"), "");
    } catch (error) {
      tellTrouble(byId("session-trouble"), error);
    } finally {
      if (go instanceof HTMLButtonElement) go.disabled = false;
    }
  });

  // Another operator may have added participants.
  for (const way of ["pointerenter", "focus"]) participants.addEventListener(way, refresh);
  // A researcher may have opened or closed a study.
  for (const way of ["pointerenter", "focus"]) studies.addEventListener(way, refresh);
  const typed = byId("code", HTMLInputElement);
  typed.addEventListener("input", () => {
    typed.value = asCode(typed.value);
  });
  byId("add-participant").onclick = () => {
    askIn(byId("participant-dialog", HTMLDialogElement), byId("participant-trouble"), add);
  };

  /** @param {boolean} participantToo whether another participant comes next */
  function forget(participantToo) {
    if (participantToo) participants.value = "";
    protocols.value = "";
    studies.value = "";
    if (choices) drawProtocols(choices);
    drawSummary();
  }

  return { refresh, forget };
}
