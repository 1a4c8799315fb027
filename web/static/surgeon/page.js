// The surgeon's page: follows the session's state as the server sends it, and shows the same whatever is being tried.

import { get, heardAgain, post, Refused, tellTrouble } from "../shared/api.js";
import { changeNotice } from "./notice.js";
import { composer } from "./comment_box.js";
import { byId, clockText, make, setText } from "../shared/dom.js";
import { Draft, draftsOf, forgetDraft } from "./drafts.js";
import { holdingTeller } from "./holding.js";
import { unlessOvertaken } from "../shared/live.js";
import { Outbox } from "./outbox.js";
import { onTopOf, questionForm } from "./question_form.js";
import { twoTaps } from "./confirm.js";
import { mountViewer } from "../shared/viewer.js";

const ANSWERS = "/api/surgeon/answers";
const outbox = new Outbox();
const viewer = mountViewer(byId("view"), { role: "surgeon" });
let state = null;
let known = false;
let endsAt = null;

const here = () => state && { session: state.session, segment: state.segment, setting: state.setting, frame: viewer.frame ?? null, run: viewer.run ?? null };
const comments = composer(outbox, here);
const holding = holdingTeller(outbox, () => comments.unsent());
const change = changeNotice(byId("comment"), (segment) => act({ action: "acknowledge", segment }));
const finishUntapped = twoTaps(byId("finish"), byId("finish-heard"), () => act({ action: "finish-segment", segment: state.segment }));

/* State in */

function follow(next) {
  known = true;
  state = next;
  endsAt = next?.remaining_seconds == null ? null : performance.now() + next.remaining_seconds * 1000;
  drawBar();
  comments.follow(state);
  drawPanel();
  // After the form has gone, which hands over what stood in it.
  sendLeftAnswers();
  takeAnswers();
  holding.follow(state);
  if (state?.phase === "notice" && !state.paused) change.show(state);
  else change.hide();
}

const followAnswer = unlessOvertaken(viewer.live, follow);

async function refresh() {
  try {
    await followAnswer(get("/api/surgeon/session"));
  } catch (error) {
    tellTrouble(byId("trouble"), error);
  }
}

/** Does `action`; the page then shows what the server's state says, whether this tab or another moved it. */
async function act(action) {
  try {
    await followAnswer(post("/api/surgeon/actions", { session: state.session, ...action }));
    setText(byId("trouble"), "");
  } catch (error) {
    const refused = error instanceof Refused;
    change.ask(refused ? "Tap to continue" : "No answer yet: tap again");
    if (refused && error.status < 500) await refresh();
    if (stands(action)) tellTrouble(byId("trouble"), error, "The server does not answer. Try again in a moment.");
  }
}

/** Whether the page still stands where `action` was meant, so that its refusal is news. */
function stands(action) {
  return state !== null && (action.segment === undefined || action.segment === state.segment);
}

/* Bar */

function drawBar() {
  const inside = state?.segment != null;
  setText(byId("setting"), inside ? `Setting ${state.setting} of ${state.settings}` : (state?.title ?? "Live view"));
  const steps = Array.from({ length: state?.settings ?? 0 }, (_, index) => {
    const number = index + 1;
    const over = number < state.setting || (number === state.setting && state.segment === null);
    return make("li", { className: over ? "done" : number === state.setting ? "now" : "" });
  });
  byId("steps").replaceChildren(...steps);
  byId("practice").hidden = !state?.practice;
  const inspecting = state?.phase === "inspecting";
  byId("finish").hidden = !inspecting;
  byId("finish").disabled = !inspecting || state.paused;
  if (byId("finish").disabled) finishUntapped();
  setText(byId("unrecorded"), state?.unrecorded ? "This step is not recorded yet: the server cannot write to its disk. Tell the operator." : "");
  setText(byId("prompt"), inspecting && !state.paused ? (state.prompt ?? "") : "");
  drawTime();
}

function drawTime() {
  const left = byId("remaining");
  if (state?.phase !== "inspecting" || endsAt === null) return setText(left, "");
  if (state.paused) return setText(left, "Paused");
  setText(left, `${clockText((endsAt - performance.now()) / 1000, Math.ceil)} left`);
}

function followStatus({ camera_simulated: camera, lens_simulated: lens, notice }) {
  const simulated = [camera && "camera", lens && "lens"].filter(Boolean).join(" and ");
  byId("simulated").hidden = simulated === "";
  setText(byId("simulated"), `Simulated ${simulated}`);
  setText(byId("device-notice"), notice ?? "");
}

/* What stands over the picture */

let drawn = "";

const ended = () => state?.phase === "completed" || state?.phase === "aborted";

function drawPanel() {
  const panel = byId("panel");
  const key = JSON.stringify(state && [state.session, state.phase, state.paused, state.segment, state.questions, ended() && kept(), state.may_resume && saved()]);
  if (key === drawn) return;
  drawn = key;
  const content = panelContent();
  panel.hidden = content === null;
  panel.className = `panel ${content?.className ?? ""}`;
  panel.replaceChildren(...(content?.nodes ?? []));
  panel.scrollTop = 0;
  const heading = panel.querySelector("h2");
  if (heading && document.activeElement === document.body) heading.focus();
}

function card(className, heading, text, ...more) {
  const title = make("h2", { tabIndex: -1 }, heading);
  return { className, nodes: [make("div", { className: "panel-card", role: "status" }, title, make("p", {}, text), ...more)] };
}

function panelContent() {
  if (!known) return null;
  if (!state) return card("aside", "No trial is under way", "The view is live. A trial begins here by itself when the operator starts one.");
  if (state.paused && !ended()) return paused();
  switch (state.phase) {
    case "ready":
      return card("aside", state.title, `${state.settings === 1 ? "One setting" : `${state.settings} settings`} to look at, one after another. Waiting for the operator to start.`);
    case "questions":
      return questions(`Setting ${state.setting}: a few questions`);
    case "closing":
      return questions("To finish");
    case "completed":
      return card("centred", "Thank you", `The trial is complete. ${kept()}`);
    case "aborted":
      return card("centred", "The session was ended", `There is nothing more to do. ${kept()}`);
    default:
      return null;
  }
}

function kept() {
  return comments.unsent() ? "Your last comment is still in its box: send it, or clear it." : saved();
}

/** Whether all is saved, said only when it is so. */
function saved() {
  const refused = outbox.refused(state.session).length;
  const said = refused === 1 ? "One thing that you said" : `${refused} things that you said`;
  const told = refused > 0 ? `${said} could not be saved and ${refused === 1 ? "is" : "are"} kept on this device: tell the operator. ` : "";
  if (outbox.waiting.length > 0) return `${told}Please leave this page open: some of what you said is still being saved.`;
  return told.trim() || "Everything you said is saved.";
}

function paused() {
  const resume = make("button", { type: "button", className: "primary", onclick: () => act({ action: "resume" }) }, "Go on");
  const text = state.may_resume ? `The server was restarted. ${saved()} Go on where you were.` : "The operator has paused the session. You can still comment.";
  return card("centred clear", "Paused", text, state.may_resume && resume);
}

/* Questions */

const asked = () => ({ session: state.session, segment: state.phase === "questions" ? state.segment : null });
const slot = ({ id }, { session, segment } = asked()) => `${session}/${segment ?? "closing"}/${id}`;

/** Text answers left half-written, in whatever tab, by questions that are no longer on screen are sent as they stand. */
function sendLeftAnswers() {
  const present = /questions|closing/.test(state?.phase) ? slot({ id: "" }) : null;
  for (const left of draftsOf("answer.")) {
    const { rest: place, value: text } = left;
    if (typeof text !== "string" || (present !== null && place.startsWith(present))) continue;
    const [session, segment, ...question] = place.split("/");
    const about = { session, segment: segment === "closing" ? null : segment, question: question.join("/") };
    if (text.trim()) outbox.add(ANSWERS, { ...about, value: text.trim() }, place, left);
    forgetDraft(left);
  }
}

function questions(heading) {
  // What is given belongs here, wherever the session has gone meanwhile.
  const place = asked();
  const { segment } = place;
  const answers = { ...state.answers };
  for (const question of state.questions) {
    for (const { body } of outbox.pending(slot(question, place))) answers[question.id] = onTopOf(answers[question.id], body.value);
  }
  const boxes = questionForm(state.questions, {
    answers,
    settings: state.settings,
    draft: (question) => new Draft(`answer.${slot(question, place)}`),
    give(question, value, part = null, from = {}) {
      const whole = slot(question, place);
      outbox.add(ANSWERS, { ...place, question: question.id, value }, part === null ? whole : `${whole}/${part}`, from);
      settle(question);
    },
  });
  const done = make("button", { type: "button", className: "primary", onclick: () => finishQuestions(segment) }, segment === null ? "Finish" : "Continue");
  const missing = make("p", { id: "missing", className: "message", role: "alert" });
  const title = make("h2", { tabIndex: -1 }, heading);
  return { className: "", nodes: [make("div", { className: "questions" }, title, ...boxes, make("div", { className: "done" }, missing, done))] };
}

async function finishQuestions(segment) {
  const boxes = [...byId("panel").querySelectorAll(".question")];
  for (const area of byId("panel").querySelectorAll("textarea")) area.give();
  const wanting = boxes.filter((box) => unanswered(box));
  const places = boxes.map((box) => box.want(wanting.includes(box))).filter(Boolean);
  if (wanting.length > 0) {
    tellMissing(wanting.length === 1 ? "One question is still open." : `${wanting.length} questions are still open.`);
    places[0].scrollIntoView({ block: "center" });
    return places[0].querySelector("input, textarea, button.confirm")?.focus({ preventScroll: true });
  }
  tellMissing("Saving…");
  if (!(await outbox.settled(ANSWERS))) return tellMissing(`${outbox.trouble} Your answers are kept on this device.`, true);
  if (byId("panel").querySelector(".state.refused")) return tellMissing("An answer was not taken: see above.");
  await act({ action: "finish-questions", segment });
  // What stopped it is said by the dock, right beneath.
  if (byId("missing")) tellMissing("");
}

/** Says why the questions are not done with; `unheard`: until the server answers again. */
function tellMissing(text, unheard = false) {
  byId("missing").toggleAttribute("data-unheard", unheard);
  setText(byId("missing"), text);
}

const boxOf = (id) => byId("panel").querySelector(`[data-question="${CSS.escape(id)}"]`);

/** Shows what was answered on another device meanwhile. */
function takeAnswers() {
  for (const question of state?.questions ?? []) {
    const answer = state.answers[question.id];
    if (answer !== undefined && outbox.pending(slot(question)).length === 0) boxOf(question.id)?.take(answer);
  }
}

/** Takes back that `question` is still open. */
function settle({ id }) {
  boxOf(id)?.classList.remove("wanting");
  if (byId("missing") && !byId("panel").querySelector(".wanting")) setText(byId("missing"), "");
}

function unanswered(box) {
  const question = state.questions.find(({ id }) => id === box.dataset.question);
  if (box.begun()) return true;
  return question && !question.optional && !/saving|saved|waiting/.test(box.querySelector(":scope > .state").className);
}

outbox.addEventListener("change", ({ detail: { entry, state: reached, reason } }) => {
  if (state) drawPanel();
  if (entry.path !== ANSWERS) return;
  const { session, segment, question: id, value } = entry.body;
  if (!state || session !== state.session || segment !== asked().segment) return;
  if (reached === "saved") state.answers[id] = onTopOf(state.answers[id], value);
  const last = outbox.pending(slot({ id })).length === 0;
  if (reached !== "saved" || last) boxOf(id)?.show(reached, reason);
  // Another device may have given a newer answer, which counts: the server knows.
  if (reached === "saved" && last) refresh();
});

/* Wiring */

byId("comment").addEventListener("input", () => {
  if (!ended()) return;
  drawPanel();
  holding.tell();
});

viewer.live.addEventListener("session", (event) => follow(event.detail));
viewer.live.addEventListener("status", (event) => followStatus(event.detail));
viewer.live.addEventListener("connection", ({ detail: { open } }) => {
  if (!open) return;
  outbox.nudge();
  holding.tell();
  heardAgain();
});
for (const box of document.querySelectorAll("[data-overlay]")) {
  box.addEventListener("change", () => viewer.overlay(box.dataset.overlay, box.checked));
}
document.addEventListener("pointerdown", (event) => {
  const menu = byId("overlays");
  if (!menu.contains(event.target)) menu.open = false;
});
setInterval(drawTime, 250);
refresh();
