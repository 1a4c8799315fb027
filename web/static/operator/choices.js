// What a session can be prepared with, and which policies there are: the page's lists of them.

import { get, post } from "../shared/api.js";
import { askIn } from "../shared/dialogs.js";
import { byId, make, setText } from "../shared/dom.js";
import { tell, tellTrouble } from "../shared/trouble.js";
import { BY_HAND, UNTOLD } from "./focus_card.js";
import { protocolWords } from "./session_words.js";

/** @typedef {{ value: string, label: string, disabled?: boolean, hidden?: boolean }} Option */

const participants = byId("participant", HTMLSelectElement);
const protocols = byId("protocol", HTMLSelectElement);
const policies = byId("policy", HTMLSelectElement);
const studies = byId("study", HTMLSelectElement);

/** What stands in the list of studies for a session outside any. */
const OUTSIDE = "outside";

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
  fill(
    participants,
    now.participants.map((code) => ({ value: code, label: code })),
    participant,
  );
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
 * Whoever has no open study never hears of one. With one, nothing is chosen beforehand: a session
 * that was meant for the study must not end up outside.
 *
 * @param {Api.Choices} now
 */
function drawStudies(now) {
  const open = now.studies.flatMap(({ study, title, sites }) =>
    sites.map((site) => ({ value: `${study}/${site}`, label: `${title} (${study}), ${site}` })),
  );
  byId("study-choice").hidden = open.length === 0;
  studies.required = open.length > 0;
  fill(
    studies,
    [{ value: "", label: "Choose…" }, ...open, { value: OUTSIDE, label: "Outside any study" }],
    studies.value,
  );
}

/** The study and site that are chosen. */
function chosenStudy() {
  const [study = "", site = ""] = studies.value.split("/");
  return site ? { study, site } : undefined;
}

/**
 * The protocols that can be chosen: in a study those of its plan.
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
  fill(
    protocols,
    offeredProtocols(now).map(({ name, researcher_title: label }) => ({ value: name, label })),
    protocols.value,
  );
}

function drawSummary() {
  // With its title: the list cuts long ones off.
  const offered = choices ? offeredProtocols(choices) : [];
  const protocol = offered.find(({ name }) => name === protocols.value);
  setText(byId("protocol-summary"), protocol ? protocolWords(protocol) : "");
}

/**
 * Follows what the server offers: `drawn` is called after the lists were drawn anew, `prepare` with
 * the answer to a session that was prepared. Returns what asks the server again.
 *
 * @param {() => void} drawn
 * @param {(answer: Promise<Api.OperatorView | null>) => Promise<void>} prepare
 */
export function followChoices(drawn, prepare) {
  async function refresh() {
    const before = choices;
    try {
      const now = await get("/api/operator/choices");
      // An open list is drawn anew only for news, and never for what was so before a participant was added here.
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
    if (!choices) return;
    choices = { ...choices, participants: codes };
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
    }
  });

  // Another operator may have added participants.
  for (const way of ["pointerenter", "focus"]) participants.addEventListener(way, refresh);
  // And a researcher may have opened or closed a study.
  for (const way of ["pointerenter", "focus"]) studies.addEventListener(way, refresh);
  byId("add-participant").onclick = () => {
    askIn(byId("participant-dialog", HTMLDialogElement), byId("participant-trouble"), add);
  };
  return refresh;
}
