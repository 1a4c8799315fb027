// The recording card: what is being recorded, how long the disk will last, and the button that starts and stops it.

import { get, post } from "../shared/api.js";
import { announce, byId, setText } from "../shared/dom.js";
import { tell, tellTrouble } from "../shared/trouble.js";
import { exceptDouble, ignoreHeldKeys } from "./double_click.js";
import { diskWords, nowWords } from "./recording_words.js";

const PATH = "/api/operator/recording";
const EVERY_MS = 2000;

const button = byId("record", HTMLButtonElement);
let recording = false;
let busy = false;
/** The notice that was on the page when the session under way began; it is not shown again. */
let dismissed = "";
let notice = "";

/** Another session begins: the notice about an earlier one's recording is no longer shown. */
export function forgetNotice() {
  dismissed = notice;
  byId("recording-notice").hidden = true;
}

/** @param {Api.RecordingStatus} status */
function draw(status) {
  recording = Boolean(status.recording);
  setText(byId("recording-now"), nowWords(status));
  announce(byId("recording-heard"), nowWords(status));
  setText(byId("recording-disk"), diskWords(status));
  drawNotice(status);
  setText(byId("recording-unavailable"), recording ? "" : (status.unavailable ?? ""));

  setText(button, recording ? "Stop recording" : "Record mosaics");
  button.disabled = busy || (!recording && Boolean(status.unavailable));
}

/**
 * Says how the last recording ended. It is a warning only if something went wrong.
 *
 * @param {Api.RecordingStatus} status
 */
function drawNotice({ notice: now, notice_warns: warns }) {
  notice = now ?? "";
  // After another recording the same notice is news again.
  if (recording) dismissed = "";
  const line = byId("recording-notice");
  line.className = warns ? "notice-line warn" : "notice-line";
  line.setAttribute("role", warns ? "alert" : "status");
  const isNews = !recording && notice !== "" && notice !== dismissed;
  setText(line, isNews ? notice : "");
  line.hidden = !isNews;
}

async function refresh() {
  if (document.hidden || busy) return;
  try {
    const status = await get(PATH);
    if (!busy) draw(status);
  } catch {
    // Another part of the page already says that the server does not answer.
  }
}

async function turn() {
  busy = true;
  button.disabled = true;
  try {
    const status = await post(PATH, { record: !recording });
    busy = false;
    tell(byId("recording-trouble"), "");
    draw(status);
  } catch (error) {
    busy = false;
    button.disabled = false;
    tellTrouble(byId("recording-trouble"), error);
  }
}

/** Keeps the card up to date. */
export function followRecording() {
  button.addEventListener("click", exceptDouble(turn));
  ignoreHeldKeys(button);
  document.addEventListener("visibilitychange", refresh);
  setInterval(refresh, EVERY_MS);
  refresh();
}
