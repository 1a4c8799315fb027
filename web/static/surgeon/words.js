// The session's texts for the surgeon.

import { say } from "../shared/language.js";
import { clockText } from "../shared/text.js";

/** @typedef {Api.SurgeonView} View */

/** @param {View | null} state */
export function isEnded(state) {
  return state?.phase === "completed" || state?.phase === "aborted";
}

/** @param {View | null} state */
export function headline(state) {
  if (state?.segment != null) return say("setting-of", { setting: state.setting, settings: state.settings });
  return state?.title ?? say("live-view");
}

/**
 * The state of each setting, in order; empty for a setting that is still to come.
 *
 * @param {View | null} state
 * @returns {("done" | "now" | "")[]}
 */
export function steps(state) {
  if (!state) return [];
  return Array.from({ length: state.settings }, (_, index) => {
    const number = index + 1;
    const isOver = number < state.setting || (number === state.setting && state.segment == null);
    if (isOver) return "done";
    return number === state.setting ? "now" : "";
  });
}

/** The end of a setting is announced this many seconds before. */
const SOON_SECONDS = 10;

/**
 * Whether the setting's time ends in a moment.
 *
 * @param {View | null} state
 * @param {number | null} seconds left of the setting's time; null if it has no limit
 */
export function endsSoon(state, seconds) {
  return state?.phase === "inspecting" && !state.paused && seconds !== null && seconds <= SOON_SECONDS;
}

/**
 * @param {View | null} state
 * @param {number | null} seconds left of the setting's time; null if it has no limit
 */
export function timeLeft(state, seconds) {
  if (state?.phase !== "inspecting" || seconds === null) return "";
  return state.paused ? say("paused") : say("time-left", { time: clockText(seconds, Math.ceil) });
}

/**
 * Says what paused the session, and what the surgeon can do.
 *
 * @param {View} state
 * @param {string} saved says what is saved
 */
export function pausedWords({ paused_by: by }, saved) {
  switch (by) {
    case "surgeon":
      return say("paused-by-you");
    case "restart":
      return say("paused-by-restart", { saved });
    case "tablet-away":
      return say("paused-by-absence", { saved });
    case "small-picture":
      return say("paused-by-picture");
    default:
      return say("paused-by-operator");
  }
}

/** @param {Stream.SurgeonStatus} status */
export function simulatedWords({ camera_simulated: camera, lens_simulated: lens }) {
  if (camera && lens) return say("simulated-both");
  if (camera) return say("simulated-camera");
  return lens ? say("simulated-lens") : "";
}

/**
 * What is wrong with the devices; empty if nothing is.
 *
 * @param {Stream.SurgeonStatus} status
 */
export function noticeWords({ notice }) {
  if (notice === "camera-failed") return say("camera-failed");
  return notice === "lens-failed" ? say("lens-failed") : "";
}

/** @param {View} state */
export function readyWords({ settings }) {
  return say("ready", { settings });
}

/**
 * Says what is not saved yet. It says that everything is saved only if that is true.
 *
 * @param {number} refused number of comments and answers that the server refused and this device keeps
 * @param {number} waiting number of comments and answers that are not saved yet
 */
export function savedWords(refused, waiting) {
  const kept = refused > 0 ? [say("kept-refused", { count: refused })] : [];
  if (waiting > 0) return [...kept, say("still-saving")].join(" ");
  return kept[0] ?? say("all-saved");
}

/**
 * One line about what the server does not have yet: where it is kept, and what will become of it.
 *
 * @param {object} held
 * @param {number} held.comments
 * @param {number} held.recordings
 * @param {boolean} held.durable whether this device keeps all of it over a reload
 * @param {string | null} held.trouble why the last attempt to send failed
 */
export function heldWords({ comments, recordings, durable, trouble }) {
  const what = [
    comments > 0 && say("held-comments", { count: comments }),
    recordings > 0 && say("held-recordings", { count: recordings }),
  ];
  const listed = { what: what.filter(Boolean).join(", ") };
  const where = durable ? say("held-here", listed) : say("held-on-page", listed);
  const then = trouble === say("no-connection") ? say("sent-later") : (trouble ?? "");
  return `${where} ${then}`.trim();
}
