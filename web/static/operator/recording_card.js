// The recording card: what is being recorded, how long the disk will last, and the button that starts and stops it.

import { get, post } from "../shared/api.js";
import { byId, setText } from "../shared/dom.js";
import { tell, tellTrouble } from "../shared/trouble.js";
import { diskWords, nowWords } from "./recording_words.js";

const PATH = "/api/operator/recording";
const EVERY_MS = 2000;

const button = byId("record", HTMLButtonElement);
let recording = false;
let busy = false;

/** @param {Api.RecordingStatus} status */
function draw(status) {
  recording = Boolean(status.recording);
  setText(byId("recording-now"), nowWords(status));
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
function drawNotice({ notice, notice_warns: warns }) {
  const line = byId("recording-notice");
  line.className = warns ? "notice-line warn" : "notice-line";
  line.setAttribute("role", warns ? "alert" : "status");
  setText(line, (!recording && notice) || "");
  line.hidden = recording || !notice;
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
  button.addEventListener("click", turn);
  document.addEventListener("visibilitychange", refresh);
  setInterval(refresh, EVERY_MS);
  refresh();
}
