// The surgeon's page: follows the session's state as the server sends it. It looks the same for every policy.

import { get, post, Refused } from "../shared/api.js";
import { Contact } from "../shared/contact.js";
import { byId, make, setText } from "../shared/dom.js";
import { unlessOvertaken } from "../shared/live.js";
import { followOverlayBoxes } from "../shared/overlay_boxes.js";
import { serverAnswered, tell, tellTrouble } from "../shared/trouble.js";
import { Viewer } from "../shared/viewer.js";
import { PATH as ANSWERS, placeOf, sendLeftAnswers, slotOf } from "./answers.js";
import { Awake, screenLock } from "./awake.js";
import { commentBox } from "./comment_box.js";
import { Comments } from "./comments.js";
import { askForSecondPress } from "./confirm_button.js";
import {
  clock,
  drafts,
  lastView,
  later,
  openOutbox,
  openVoiceOutbox,
  origins,
  reloadForMicrophone,
  storage,
} from "./device.js";
import { Holding } from "./holding.js";
import { record } from "./microphone.js";
import { noticeDialog } from "./notice_dialog.js";
import { nowWords } from "./now.js";
import { forgetPage, keepPage } from "./offline.js";
import { card, showPanel } from "./panel.js";
import { QuestionPanel } from "./question_panel.js";
import { onTopOf } from "./questions.js";
import { keepStorage } from "./storage_words.js";
import { Talk } from "./talk.js";
import { talkButton } from "./talk_button.js";
import { headline, isEnded, readyWords, savedWords, simulatedWords, steps, timeLeft } from "./words.js";

const TICK_MS = 250;

/** @typedef {Api.SurgeonView} View */

/** @type {View | null} */
let state = null;
/** Whether the session under way is known, from the server or from what an earlier load of this page has kept. */
let known = false;
/** When the setting's time ends, by the page's clock. @type {number | null} */
let endsAt = null;
/** @type {QuestionPanel | null} */
let questionPanel = null;
let panelDrawn = "";

const outbox = openOutbox();
const contact = new Contact(clock, lastView.read());
const viewer = new Viewer(byId("view"), "surgeon");
const comments = new Comments(outbox, drafts, here);
const box = commentBox(comments, outbox);
const voice = openVoiceOutbox();
const mayRecord = byId("talk").dataset.microphone === "true";
const talk = new Talk({
  outbox: voice,
  record,
  here,
  stamp: () => origins.stamp(),
  now: () => performance.now(),
  later,
  changed: () => talking.draw(),
});
const talking = talkButton(talk, voice, mayRecord);
const holding = new Holding({
  outbox,
  voice,
  drafts,
  later,
  unsent: () => comments.unsent,
  post: (session, count) =>
    post("/api/surgeon/holding", { session, device: origins.device(), holding: count }),
});
const notice = noticeDialog(byId("comment", HTMLTextAreaElement), (segment) =>
  act({ action: "acknowledge", segment }),
);
const awake = new Awake({
  request: screenLock(),
  isVisible: () => !document.hidden,
  changed: () => drawPanel(),
});
const forgetFirstPress = askForSecondPress(byId("finish"), byId("finish-heard"), () => {
  if (state?.segment) act({ action: "finish-segment", segment: state.segment });
});

/** What is on screen at this moment; null outside a session. */
function here() {
  if (!state) return null;
  const { session, segment = null, setting } = state;
  return { session, segment, setting, frame: viewer.frame, run: viewer.run };
}

/* State in */

/**
 * Follows the view that the server has sent; null if no session is under way.
 *
 * @param {View | null} next
 */
function followServer(next) {
  lastView.keep(next);
  if (next && !state) keepStorage();
  if (next?.voice && !mayRecord && !comments.unsent && reloadForMicrophone(next.session)) return;
  follow(next);
}

/** Shows the last view that was kept, if the page was loaded while the server is silent. */
function followLastView() {
  const last = known ? null : lastView.read();
  if (last) follow(last.view);
}

/** @param {View | null} next */
function follow(next) {
  known = true;
  state = next;
  const seconds = next?.remaining_seconds;
  endsAt = seconds == null ? null : performance.now() + seconds * 1000;

  drawBar();
  box.follow(state);
  talking.follow(state);
  drawPanel();
  // Only after the form was removed, because removing it hands over the text that was in it.
  sendLeftAnswers(outbox, drafts, state);
  if (state) questionPanel?.takeAnswers(state);
  holding.follow(state);
  awake.follow(state);
  drawNow();

  if (state?.phase === "notice" && !state.paused) notice.show(state);
  else notice.hide();
}

const followAnswer = unlessOvertaken(viewer.live, followServer);

async function refresh() {
  try {
    await followAnswer(get("/api/surgeon/session"));
  } catch (error) {
    // If the server does not answer, the top of the page says so, and the live connection asks again.
    if (error instanceof Refused) tell(byId("trouble"), error.message);
  }
}

/**
 * Does `action`. The page then shows the server's state, no matter which tab changed it.
 *
 * @param {Api.Action} action
 */
async function act(action) {
  if (!state) return;
  try {
    await followAnswer(post("/api/surgeon/actions", { session: state.session, ...action }));
    tell(byId("trouble"), "");
  } catch (error) {
    const refused = error instanceof Refused;
    notice.ask(refused ? "Tap to continue" : "The server did not answer. Tap again.");
    if (refused && error.status < 500) await refresh();
    if (isStillMeant(action)) {
      tellTrouble(byId("trouble"), error, "The server does not answer. Try again in a moment.");
    }
  }
}

/**
 * Whether the session is still at the point for which `action` was meant, so that its refusal matters.
 *
 * @param {Api.Action} action
 */
function isStillMeant(action) {
  if (state === null) return false;
  return !("segment" in action) || action.segment === (state.segment ?? null);
}

/* Bar */

function drawBar() {
  setText(byId("setting"), headline(state));
  byId("steps").replaceChildren(...steps(state).map((className) => make("li", { className })));
  byId("practice").hidden = !state?.practice;

  const finish = byId("finish", HTMLButtonElement);
  const inspecting = state?.phase === "inspecting";
  const looking = inspecting && !state?.paused;
  finish.hidden = !inspecting;
  finish.disabled = !looking;
  if (finish.disabled) forgetFirstPress();

  const unrecorded =
    "This step is not recorded yet because the server cannot write to its disk. Tell the operator.";
  setText(byId("unrecorded"), state?.unrecorded ? unrecorded : "");
  setText(byId("prompt"), looking ? (state?.prompt ?? "") : "");
  drawTime();
}

function drawTime() {
  const left = endsAt === null ? null : (endsAt - performance.now()) / 1000;
  setText(byId("remaining"), timeLeft(state, left));
}

function drawNow() {
  const facts = {
    view: state,
    known,
    missed: contact.isMissed,
    heardAt: contact.heardAt,
    refused: contact.isCertificateOver,
    unsent: comments.unsent,
    unsaved: outbox.waiting.length + voice.waiting > 0,
  };
  setText(byId("now"), nowWords(facts));
}

/** @param {Stream.SurgeonStatus} status */
function followStatus(status) {
  contact.certifiedUntil(status.certificate_until);
  const simulated = simulatedWords(status);
  byId("simulated").hidden = simulated === "";
  setText(byId("simulated"), simulated);
  setText(byId("device-notice"), status.notice ?? "");
}

/* Panel over the picture */

function drawPanel() {
  const { session, phase, paused, segment, questions, may_resume: mayResume } = state ?? {};
  const words = isEnded(state) ? kept() : mayResume ? saved() : "";
  const key = JSON.stringify([known, session, phase, paused, segment, questions, mayResume, words, advice()]);
  if (key === panelDrawn) return;
  panelDrawn = key;
  questionPanel = null;
  showPanel(panelContent());
}

function panelContent() {
  if (!known) return null;
  if (!state) {
    const text = "You can look around. When the operator starts a trial, it begins here.";
    return card("aside", "No trial is under way", text);
  }
  if (state.paused && !isEnded(state)) return pausedCard(state);

  switch (state.phase) {
    case "ready":
      return card("aside", state.title, [readyWords(state), ...advice()].join(" "));
    case "questions":
      return questions(state, `Setting ${state.setting}: a few questions`);
    case "closing":
      return questions(state, "Final questions");
    case "completed":
      return card("centred", "Thank you", `The trial is complete. ${kept()}`);
    case "aborted":
      return card("centred", "The session was ended", `There is nothing more to do. ${kept()}`);
    default:
      return null;
  }
}

/** What people have to do before the trial starts, because the browser does not do it. */
function advice() {
  return [awake.advice, storage].filter((words) => words !== "");
}

function kept() {
  return comments.unsent ? "Your last comment is still in the box. Save it or delete it." : saved();
}

function saved() {
  const refused = state ? outbox.refused(state.session).length + voice.refused(state.session) : 0;
  return savedWords(refused, outbox.waiting.length + voice.waiting);
}

/** @param {View} view */
function pausedCard({ may_resume: mayResume }) {
  const text = "The operator has paused the session. You can still comment.";
  if (!mayResume) return card("centred clear", "Paused", text);

  const resume = make("button", { type: "button", className: "primary" }, "Continue");
  resume.onclick = () => act({ action: "resume" });
  return card(
    "centred clear",
    "Paused",
    `The server was restarted. ${saved()} Continue where you were.`,
    resume,
  );
}

/**
 * @param {View} view
 * @param {string} heading
 */
function questions(view, heading) {
  questionPanel = new QuestionPanel(view, outbox, (segment) => act({ action: "finish-questions", segment }));
  return questionPanel.content(heading);
}

outbox.subscribe(({ entry, state: reached, reason }) => {
  if (state) drawPanel();
  if (entry.path !== ANSWERS || !state) return;

  const { session, segment, question, value } = entry.body;
  const place = placeOf(state);
  if (session !== place.session || segment !== place.segment) return;
  if (reached === "saved") state.answers[question] = onTopOf(state.answers[question], value);

  const isLast = outbox.pending(slotOf(place, question)).length === 0;
  if (reached !== "saved" || isLast) questionPanel?.show(question, reached, reason);
  // Another device may have given a newer answer, which counts instead. The server knows.
  if (reached === "saved" && isLast) refresh();
});

voice.subscribe(() => {
  if (state) drawPanel();
});

/* Wiring */

byId("comment").addEventListener("input", () => {
  if (!isEnded(state)) return;
  drawPanel();
  holding.tell();
});

viewer.live.listen({
  heard: () => contact.heard(),
  session: followServer,
  status: followStatus,
  // The session is over for this tablet. What the tablet holds is still sent. The server's answer says the rest.
  over: () => {
    forgetPage();
    followServer(null);
    refresh();
  },
  connection: (open) => {
    if (!open) {
      contact.lost();
      return;
    }
    contact.heard();
    outbox.nudge();
    voice.nudge();
    holding.tell();
    serverAnswered();
  },
});

followOverlayBoxes((name, on) => {
  viewer.overlay(/** @type {import("../shared/viewer.js").Overlay} */ (name), on);
});

document.addEventListener("pointerdown", (event) => {
  const menu = byId("overlays", HTMLDetailsElement);
  if (!(event.target instanceof Node && menu.contains(event.target))) menu.open = false;
});

function tick() {
  drawTime();
  if (contact.isMissed) followLastView();
  drawNow();
}

document.addEventListener("visibilitychange", () => awake.ask());
// The next load of the page must know since when the server is silent, and whether its certificate has ended.
addEventListener("pagehide", () => {
  const { heardAt, certificateEnd } = contact;
  if (heardAt !== null) lastView.touch({ heardAt, certificateEnd });
});

setInterval(tick, TICK_MS);
keepPage();
refresh();
