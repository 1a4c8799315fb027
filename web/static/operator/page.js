// The operator's page: the devices, and the session from preparing it to its end.

import { get } from "../shared/api.js";
import { Contact } from "../shared/contact.js";
import { byId, setText } from "../shared/dom.js";
import { unlessOvertaken } from "../shared/live.js";
import { followOverlayBoxes } from "../shared/overlay_boxes.js";
import "../shared/sign_in.js";
import { serverAnswered } from "../shared/trouble.js";
import { Viewer } from "../shared/viewer.js";
import { drawCamera } from "./camera_card.js";
import { followChecks } from "./checks_card.js";
import { followChoices } from "./choices.js";
import { drawDeviceWords, drawLamps, drawWarnings } from "./devices.js";
import { drawFocus } from "./focus_card.js";
import { nowWords } from "./now.js";
import { followRecording } from "./recording_card.js";
import { SessionCard } from "./session_card.js";
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

/** Whether the checks found something to put right before a trial. */
let wrong = false;
/** Whether the server has said which session, if any, is under way. */
let known = false;
const contact = new Contact({ page: () => performance.now(), wall: () => Date.now() }, null);
const viewer = new Viewer(byId("view"), "operator");
const traces = new Traces(byId("traces"));
const followAnswer = unlessOvertaken(viewer.live, followSession);
const sessionCard = new SessionCard(followAnswer);
const refreshChoices = followChoices(redrawFocus, followAnswer);

/** @param {Api.OperatorView | null} next */
function followSession(next) {
  if (session && !next) refreshChoices();
  session = next;
  known = true;
  sessionCard.follow(session);
  followLink(session);
  redrawFocus();
  drawNow();
}

function drawNow() {
  const facts = {
    view: session,
    known,
    missed: contact.isMissed,
    heardAt: contact.heardAt,
    refused: contact.isCertificateOver,
    working: status === null || (status.camera.working && status.lens.working),
    wrong,
  };
  setText(byId("now"), nowWords(facts));
}

/** @param {Stream.OperatorStatus} next */
function followStatus(next) {
  status = next;
  contact.certifiedUntil(status.certificate_until);
  drawLamps(byId("devices"), status);
  drawDeviceWords(byId("device-words"), status);
  drawWarnings(byId("warnings"), status);
  drawCamera(status.camera_offer);
  redrawFocus();
}

function redrawFocus() {
  if (status) drawFocus(status, session !== null);
}

/** @param {Stream.Frame} frame */
function followFrame({ header, receivedAt }) {
  traces.add(header, receivedAt - header.age);
  framesWithoutBelief = header.belief ? 0 : framesWithoutBelief + 1;
  byId("belief-choice").hidden = framesWithoutBelief >= BELIEF_FRAMES;
}

viewer.live.listen({
  heard: () => contact.heard(),
  frame: followFrame,
  session: followSession,
  status: followStatus,
  connection: (open) => {
    if (!open) {
      contact.lost();
      // If the sign-in has ended, the answer to this request opens the dialog to sign in. The live connection cannot.
      get("/api/operator/session").catch(() => {});
      return;
    }
    contact.heard();
    serverAnswered();
    refreshChoices();
  },
});

followOverlayBoxes((name, on) => {
  if (name === "traces" || name === "belief") traces.show(name, on);
  else viewer.overlay(/** @type {import("../shared/viewer.js").Overlay} */ (name), on);
});

offerLink();
document.addEventListener("signed-in", () => followLink(session));
followChecks((found) => {
  wrong = found;
  drawNow();
});
followRecording();
setInterval(() => {
  sessionCard.drawTime();
  drawNow();
}, TICK_MS);
refreshChoices();
