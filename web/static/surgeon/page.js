// The surgeon's page: follows the session's state as the server sends it. It looks the same for every policy.

import { get, inWords, post, Refused } from "../shared/api.js";
import { Contact } from "../shared/contact.js";
import { byId, make, setText } from "../shared/dom.js";
import { focusButtons, tellPointing } from "../shared/focus_buttons.js";
import { knows, language, say, speak } from "../shared/language.js";
import { unlessOvertaken } from "../shared/live.js";
import { followOverlayBoxes } from "../shared/overlay_boxes.js";
import { OTHER_HALF_MS } from "../shared/pointing.js";
import { Sight } from "../shared/sight.js";
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
  openHolding,
  openOutbox,
  openVoiceOutbox,
  origins,
  reloadForMicrophone,
  storage,
  store,
} from "./device.js";
import { followDimmer } from "./dimmer.js";
import { keepLanguage, learn, showLanguage } from "./languages.js";
import { closeMicrophone, mayOpenMicrophone, openMicrophone, record, whyNoMicrophone } from "./microphone.js";
import { noticeDialog } from "./notice_dialog.js";
import { nowWords } from "./now.js";
import { forgetPage, keepPage } from "./offline.js";
import { card, guardPanel, showPanel } from "./panel.js";
import { QuestionPanel } from "./question_panel.js";
import { onTopOf } from "./questions.js";
import { keepRoom } from "./room.js";
import { keepStorage } from "./storage_words.js";
import { Talk } from "./talk.js";
import { talkButton } from "./talk_button.js";
import {
  endsSoon,
  headline,
  isEnded,
  noticeWords,
  pausedWords,
  readyWords,
  savedWords,
  simulatedWords,
  steps,
  timeLeft,
} from "./words.js";

const TICK_MS = 250;

/** A silent server is asked again after this time why the link has ended. */
const ASK_AGAIN_MS = 2000;

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
/** Whether this tablet's link has ended, and why if its session had not. */
let over = false;
let overBecause = "";
/** @type {Stream.SurgeonStatus | null} */
let lastStatus = null;

const outbox = openOutbox();
const contact = new Contact(clock, lastView.read());
const viewer = new Viewer(byId("view"), "surgeon", byId("colour"));
const sight = new Sight();
const pointing = viewer.pointBy(
  (frame, at) => post("/api/surgeon/patch", { session: state?.session ?? null, frame, at }),
  (trouble) => tellPointing(byId("trouble"), trouble),
);
const focus = focusButtons(pointing, async (hold) => {
  const segment = state?.segment;
  if (segment) await act({ action: hold ? "hold-focus" : "release-focus", segment });
});
const voice = openVoiceOutbox();
const comments = new Comments(outbox, drafts, here, voice);
const box = commentBox(comments, outbox, voice);
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
const holding = openHolding(outbox, voice, () => comments.unsent);
const notice = noticeDialog(byId("comment", HTMLTextAreaElement), (segment) => {
  uncoverPicture();
  act({ action: "acknowledge", segment });
});
const awake = new Awake({
  request: screenLock(),
  isVisible: () => !document.hidden,
  changed: () => drawPanel(),
});
const forgetFirstPress = askForSecondPress(byId("finish"), byId("finish-heard"), () => {
  if (state?.segment) act({ action: "finish-segment", segment: state.segment });
});

/** A tap removes what lies over the picture. The other half of a double tap on it points at nothing. */
function uncoverPicture() {
  pointing.uncover();
  // Whoever looks from outside sees when the picture takes taps.
  const view = byId("view");
  view.dataset.fresh = "true";
  setTimeout(() => delete view.dataset.fresh, OTHER_HALF_MS + 20);
}

/** What is on screen at this moment; null outside a session. */
function here() {
  if (!state) return null;
  const { session, segment = null, setting } = state;
  const seen = sight.at(performance.now());
  return { session, segment, setting, frame: viewer.frame, run: viewer.run, ...seen };
}

/* Language */

keepLanguage();

/** Puts all words on the page into the language that is spoken now. What is drawn with the session follows anyway. */
function drawWords() {
  showLanguage();
  viewer.drawWords();
  if (lastStatus) followStatus(lastStatus);
}

/** Speaks the session's language. */
function speakAsTheSession() {
  if (state && speak(state.language)) drawWords();
}

/**
 * The same for a language that this page does not know yet. Until it is there, the session is shown in the page's
 * language: a notice must not wait for it.
 *
 * @param {string} code
 */
async function learnLanguage(code) {
  if (!(await learn(code)) || code !== state?.language) return;
  speakAsTheSession();
  drawState();
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
  const mayReload = !comments.unsent && outbox.durable && voice.durable;
  if (next?.voice && !mayRecord && mayReload && reloadForMicrophone(next.session)) return;
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
  // What went wrong in one session is not for the next participant to read.
  if (next?.session !== state?.session) talk.trouble = "";
  // Nobody needs it either once the session has moved on.
  if (next?.session !== state?.session || next?.phase !== state?.phase) tell(byId("trouble"), "");
  state = next;
  const seconds = next?.remaining_seconds;
  endsAt = seconds == null ? null : performance.now() + seconds * 1000;

  speakAsTheSession();
  drawState();
  if (next && !knows(next.language)) learnLanguage(next.language);
}

/** Draws the session's state on all parts of the page. */
function drawState() {
  drawBar();
  focus.follow(state, over);
  box.follow(state);
  talking.follow(state);
  followMicrophone();
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
    // Not the notice of the next setting, which may stand there by now and which nobody has tapped.
    if (action.action === "acknowledge" && isStillMeant(action)) {
      notice.ask(refused ? "tap-to-continue" : "tap-unanswered");
    }
    if (refused && error.status < 500) await refresh();
    // Otherwise the next press would end a hold that never began.
    focus.follow(state, over);
    if (isStillMeant(action)) {
      tellTrouble(byId("trouble"), error, say("act-unanswered"));
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

/* Microphone */

/** Whether the microphone was opened for this session, or why it could not be; empty while it is not known. */
let microphone = "";

/** Opens the microphone before the trial if the browser lets it, and closes it when no session can use it any more. */
async function followMicrophone() {
  if (leaveMicrophone()) return;
  const isAsked = microphone === "" && state?.phase === "ready" && whyNoMicrophone(mayRecord) === "";
  if (isAsked && (await mayOpenMicrophone())) await tryMicrophone();
}

/** Closes the microphone if no session can use it. Returns whether that is so. */
function leaveMicrophone() {
  if (state?.voice && !isEnded(state)) return false;
  closeMicrophone();
  microphone = "";
  return true;
}

async function tryMicrophone() {
  let words = say("microphone-ready");
  try {
    await openMicrophone();
  } catch (error) {
    words = error instanceof Error ? error.message : say("microphone-failed");
  }
  // The session may be over by the time a browser has asked its person.
  if (leaveMicrophone()) return;
  microphone = words;
  drawPanel();
}

/** The button that asks for the microphone before the trial; null where it need not. */
function microphoneButton() {
  if (!state?.voice || microphone !== "" || whyNoMicrophone(mayRecord) !== "") return null;
  const words = say("try-microphone");
  return make("button", { type: "button", className: "primary", onclick: tryMicrophone }, words);
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
  byId("pause").hidden = !state?.may_pause;

  setText(byId("unrecorded"), state?.unrecorded ? say("unrecorded") : "");
  setText(byId("prompt"), looking ? (state?.prompt ?? "") : "");
  drawTime();
}

/** Seconds left of the setting's time; null if it has no limit or is not known. */
function secondsLeft() {
  return endsAt === null ? null : (endsAt - performance.now()) / 1000;
}

function drawTime() {
  const left = secondsLeft();
  const remaining = byId("remaining");
  setText(remaining, timeLeft(state, left));
  remaining.classList.toggle("soon", endsSoon(state, left));
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
    soon: endsSoon(state, secondsLeft()),
    over,
  };
  setText(byId("now"), nowWords(facts));
}

/** @param {Stream.SurgeonStatus} status */
function followStatus(status) {
  lastStatus = status;
  contact.certifiedUntil(status.certificate_until);
  const simulated = simulatedWords(status);
  byId("simulated").hidden = simulated === "";
  setText(byId("simulated"), simulated);
  setText(byId("device-notice"), noticeWords(status));
}

/* Panel over the picture */

function drawPanel() {
  const { session, phase, paused, segment, questions, may_resume: mayResume } = state ?? {};
  const words = over || isEnded(state) ? kept() : mayResume ? saved() : "";
  // Only the card before the trial has advice. New advice must not draw questions again that are being answered.
  const advised = phase === "ready" ? advice() : [];
  const key = JSON.stringify([
    language(),
    known,
    over,
    overBecause,
    session,
    phase,
    paused,
    segment,
    questions,
    mayResume,
    words,
    advised,
  ]);
  if (key === panelDrawn) return;
  panelDrawn = key;
  questionPanel = null;
  showPanel(panelContent());
}

function panelContent() {
  if (!known) return null;
  if (over && !isEnded(state)) {
    return card("centred", say("not-open-here"), overBecause);
  }
  if (!state) {
    return card("aside idle", say("no-trial"), "");
  }
  if (state.paused && !isEnded(state)) return pausedCard(state);

  switch (state.phase) {
    case "ready":
      return card("aside", state.title, [readyWords(state), ...advice()].join(" "), microphoneButton());
    case "questions":
      return questions(state, say("few-questions", { setting: state.setting }));
    case "closing":
      return questions(state, say("final-questions"));
    case "completed":
      return state.practice
        ? card("centred", say("practice-over"), say("practice-over-more", { kept: kept() }))
        : card("centred", say("thank-you"), say("trial-complete", { kept: kept() }));
    case "aborted":
      return card("aside sign", say("session-ended"), say("nothing-more", { kept: kept() }));
    default:
      return null;
  }
}

/** What people have to do before the trial starts, because the browser does not do it. */
function advice() {
  return [awake.advice, storage(), microphone].filter((words) => words !== "");
}

function kept() {
  return comments.unsent ? say("comment-in-box") : saved();
}

function saved() {
  const refused = state ? outbox.refused(state.session).length + voice.refused(state.session) : 0;
  return savedWords(refused, outbox.waiting.length + voice.waiting);
}

/**
 * A small sign, because the picture may be needed while the session is paused.
 *
 * @param {View} view
 */
function pausedCard(view) {
  if (!view.may_resume) return card("aside sign", say("paused"), pausedWords(view, saved()));

  const resume = make("button", { type: "button", className: "primary" }, say("continue"));
  resume.onclick = () => {
    uncoverPicture();
    act({ action: "resume" });
  };
  return card("aside sign", say("paused"), pausedWords(view, saved()), resume);
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

/**
 * The tablet's link has ended. If its session has, too, the last words on the page stay as they were. What the tablet
 * holds is still sent.
 */
function leave() {
  over = true;
  forgetPage();
  lastView.forget();
  viewer.end();
  focus.follow(state, over);
  if (!isEnded(state)) followServer(null);
  drawPanel();
  drawNow();
  if (isEnded(state)) return;

  tellWhyOver();
}

/** Shows the server's answer, which says why the link has ended. A server that is silent is asked again. */
async function tellWhyOver() {
  try {
    await get("/api/surgeon/session");
    overBecause = "";
  } catch (error) {
    overBecause = inWords(error);
    if (!(error instanceof Refused)) setTimeout(tellWhyOver, ASK_AGAIN_MS);
  }
  drawPanel();
}

/* Wiring */

byId("pause").onclick = () => act({ action: "pause", reason: "" });

byId("comment").addEventListener("input", () => {
  if (!isEnded(state)) return;
  drawPanel();
  holding.tell();
});

viewer.live.listen({
  heard: () => contact.heard(),
  frame: ({ header }) => sight.see(header, performance.now()),
  session: followServer,
  status: followStatus,
  over: leave,
  connection: (open) => {
    if (!open) {
      contact.lost();
      return;
    }
    contact.heard();
    outbox.wake();
    voice.wake();
    holding.tell();
    serverAnswered();
  },
});

followOverlayBoxes((name, on) => {
  viewer.overlay(name, on);
});

document.addEventListener("pointerdown", (event) => {
  const menu = byId("overlays", HTMLDetailsElement);
  if (!(event.target instanceof Node && menu.contains(event.target))) menu.open = false;
});

function tick() {
  drawTime();
  byId("reduced").hidden = !sight.isReduced(performance.now());
  if (contact.isMissed) followLastView();
  drawNow();
}

document.addEventListener("visibilitychange", () => awake.ask());
// The next load of the page must know since when the server is silent, and whether its certificate has ended.
addEventListener("pagehide", () => {
  const { heardAt, certificateEnd } = contact;
  if (heardAt !== null) lastView.touch({ heardAt, certificateEnd });
});

guardPanel();
keepRoom();
followDimmer(byId("brightness", HTMLInputElement), store);
setInterval(tick, TICK_MS);
keepPage();
refresh();
