// The operator's page: the devices, and the session from preparing it to its end.

import { get, post, Refused } from "../shared/api.js";
import { Contact } from "../shared/contact.js";
import { byId, setText } from "../shared/dom.js";
import { focusButtons, tellPointing } from "../shared/focus_buttons.js";
import { unlessOvertaken } from "../shared/live.js";
import { followOverlayBoxes } from "../shared/overlay_boxes.js";
import "../shared/sign_in.js";
import { serverAnswered } from "../shared/trouble.js";
import { Viewer } from "../shared/viewer.js";
import { drawCamera } from "./camera_card.js";
import { followChecks } from "./checks_card.js";
import { followChoices } from "./choices.js";
import { drawDepths } from "./depths.js";
import { drawDeviceWords, drawLamps, drawWarnings } from "./devices.js";
import { drawFocus } from "./focus_card.js";
import { focusSign } from "./focus_sign.js";
import { LiveSpectra } from "./live_spectra.js";
import { nowWords } from "./now.js";
import { followRecording, forgetNotice } from "./recording_card.js";
import { SessionCard } from "./session_card.js";
import { isUnderWay } from "./session_words.js";
import { followLink, offerLink } from "./surgeon_link.js";
import { Traces } from "./traces.js";

const TICK_MS = 250;

/** After this many frames without a belief the policy counts as having none. Frames of a held lens have none either. */
const BELIEF_FRAMES = 25;

/** @type {Api.OperatorView | null} */
let session = null;
/** @type {Stream.OperatorStatus | null} */
let status = null;
let framesWithoutBelief = BELIEF_FRAMES;
/** Runs the checks again soon, once they are there. */
let checkAgain = () => {};

/** Whether the checks found something to put right before a trial. */
let wrong = false;
/** Whether it is known which session, if any, is under way. */
let known = false;
/** Whether the connection was lost, and nothing was heard of the session since. */
let wasLost = false;
/** Whether it was lost because nobody is signed in any more. */
let signedOut = false;
const contact = new Contact({ page: () => performance.now(), wall: () => Date.now() }, null);
const viewer = new Viewer(byId("view"), "operator", byId("colour"));
const pointing = viewer.pointBy(
  (frame, at) => post("/api/operator/patch", { session: session?.session ?? null, frame, at }),
  (trouble) => tellPointing(byId("pointing-trouble"), trouble),
);
const focus = focusButtons(pointing, holdFocus);
const spectra = new LiveSpectra(viewer);
const sign = focusSign(followTissue);
/** What came with the latest picture. @type {Stream.Header | null} */
let latest = null;
const traces = new Traces(byId("traces"));
viewer.addOverlay("depths", drawDepths);
const followAnswer = unlessOvertaken(viewer.live, followSession);
const sessionCard = new SessionCard(followAnswer);
const choices = followChoices(redrawFocus, followAnswer);

/** @param {Api.OperatorView | null} next */
function followSession(next) {
  // While the server was silent or ended, anything that the checks look at may have changed.
  const mayDiffer = (isAtWork() || wasLost) && !(next && isUnderWay(next));
  wasLost = false;
  if (session && !next) {
    choices.refresh();
    // After practice the same participant comes next, after a real session another one.
    choices.forget(!session.practice);
  }
  if (known && next && next.session !== session?.session) forgetNotice();
  session = next;
  known = true;
  if (mayDiffer) checkAgain();
  sessionCard.follow(session);
  followLink(session);
  focus.follow(session);
  spectra.follow(session);
  offerDepths();
  redrawFocus();
  drawTheWarnings();
  drawNow();
}

/** Offers the depth map, which nobody sees while a surgeon is at work. */
function offerDepths() {
  const offered = !isAtWork();
  byId("depths-choice").hidden = !offered;
  byId("depths-key").hidden = !offered || !byId("depths", HTMLInputElement).checked;
}

/** Whether a surgeon is at work. */
function isAtWork() {
  return session !== null && isUnderWay(session);
}

/** @param {boolean} hold */
async function holdFocus(hold) {
  const segment = session?.segment;
  if (!session || !segment) return;
  /** @type {"hold-focus" | "release-focus"} */
  const action = hold ? "hold-focus" : "release-focus";
  try {
    await followAnswer(post("/api/operator/actions", { session: session.session, action, segment }));
    tellPointing(byId("pointing-trouble"), null);
  } catch (error) {
    focus.follow(session);
    tellPointing(byId("pointing-trouble"), error);
  }
}

/**
 * Lets the place that was chosen follow the tissue, or stay on the screen.
 *
 * @param {boolean} follows
 */
async function followTissue(follows) {
  if (!latest) return;
  const { frame, patch, pointed } = latest;
  const at = pointed ? { x: patch.x + patch.width / 2, y: patch.y + patch.height / 2 } : null;
  try {
    await post("/api/operator/patch", { frame, at, follows });
    tellPointing(byId("pointing-trouble"), null);
  } catch (error) {
    if (status) sign.draw(status);
    tellPointing(byId("pointing-trouble"), error);
  }
}

function drawNow() {
  const facts = {
    view: session,
    known,
    missed: contact.isMissed,
    heardAt: contact.heardAt,
    refused: contact.isCertificateOver,
    signedOut,
    working: status === null || (status.camera.working && status.lens.working),
    wrong,
    away: status?.tablet.presence === "silent" || status?.tablet.presence === "hidden",
  };
  setText(byId("now"), nowWords(facts));
}

/** @param {Stream.OperatorStatus} next */
function followStatus(next) {
  const changed = status !== null && checked(status) !== checked(next);
  status = next;
  // The checks read the whole database, and what a surgeon says would wait for the disk.
  if (changed && !isAtWork()) checkAgain();
  contact.certifiedUntil(status.certificate_until);
  sign.draw(status);
  drawLamps(byId("devices"), status);
  drawDeviceWords(byId("device-words"), status);
  drawTheWarnings();
  drawCamera(status.camera_offer);
  redrawFocus();
}

/**
 * What the checks look at and can change at any time.
 *
 * @param {Stream.OperatorStatus} status
 */
function checked({ camera, lens, tablet }) {
  return JSON.stringify([camera.working, lens.working, tablet.presence, tablet.slow]);
}

function drawTheWarnings() {
  if (status) drawWarnings(byId("warnings"), byId("warnings-heard"), status, isAtWork());
}

function redrawFocus() {
  if (status) drawFocus(status, session);
}

/** @param {Stream.Frame} frame */
function followFrame({ header, receivedAt }) {
  latest = header;
  traces.add(header, receivedAt - header.age - header.travel);
  spectra.see(header);
  framesWithoutBelief = header.belief ? 0 : framesWithoutBelief + 1;
  byId("belief-choice").hidden = framesWithoutBelief >= BELIEF_FRAMES;
}

/**
 * Finds out whether the connection was lost because the sign-in has ended: the live connection cannot tell. If so, the
 * answer opens the dialog to sign in.
 */
async function askWhyLost() {
  try {
    await get("/api/operator/session");
    signedOut = false;
  } catch (error) {
    signedOut = error instanceof Refused && error.needsSignIn;
  }
  drawNow();
}

viewer.live.listen({
  heard: () => contact.heard(),
  frame: followFrame,
  session: followSession,
  status: followStatus,
  connection: (open) => {
    if (!open) {
      contact.lost();
      wasLost = true;
      askWhyLost();
      return;
    }
    contact.heard();
    serverAnswered();
    choices.refresh();
  },
});

followOverlayBoxes((name, on) => {
  if (name === "traces" || name === "belief") traces.show(name, on);
  else viewer.overlay(name, on);
  if (name === "depths") {
    viewer.live.tell({ type: "depths", wanted: on });
    offerDepths();
  }
});

offerLink();
document.addEventListener("signed-in", () => followLink(session));
checkAgain = followChecks((found) => {
  wrong = found;
  drawNow();
});
followRecording();
setInterval(() => {
  sessionCard.drawTime();
  drawNow();
}, TICK_MS);
choices.refresh();
