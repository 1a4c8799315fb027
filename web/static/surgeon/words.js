// The session's texts for the surgeon.

import { clockText, counted } from "../shared/text.js";

/** @typedef {Api.SurgeonView} View */

/** @param {View | null} state */
export function isEnded(state) {
  return state?.phase === "completed" || state?.phase === "aborted";
}

/** @param {View | null} state */
export function headline(state) {
  if (state?.segment != null) return `Setting ${state.setting} of ${state.settings}`;
  return state?.title ?? "Live view";
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
  return state.paused ? "Paused" : `${clockText(seconds, Math.ceil)} left`;
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
      return "You have paused the session. You can still comment.";
    case "restart":
      return `The server was restarted. ${saved} Continue where you were.`;
    case "tablet-away":
      return `This tablet was away, so the session was paused. ${saved} Continue where you were.`;
    case "small-picture":
      return "The picture was too small for this trial, so it was paused. Continue once it is better.";
    default:
      return "The operator has paused the session. You can still comment.";
  }
}

/** @param {Stream.SurgeonStatus} status */
export function simulatedWords({ camera_simulated: camera, lens_simulated: lens }) {
  const simulated = [camera && "camera", lens && "lens"].filter(Boolean).join(" and ");
  return simulated === "" ? "" : `Simulated ${simulated}`;
}

/** @param {View} state */
export function readyWords({ settings }) {
  const many = settings === 1 ? "one setting" : `${settings} settings, one after another`;
  return `You will look at ${many}. The operator will start the trial.`;
}

/**
 * Says what is not saved yet. It says that everything is saved only if that is true.
 *
 * @param {number} refused number of comments and answers that the server refused and this device keeps
 * @param {number} waiting number of comments and answers that are not saved yet
 */
export function savedWords(refused, waiting) {
  const unsaved = counted(refused, "comment or answer", "comments or answers");
  const are = refused === 1 ? "It is" : "They are";
  const kept =
    refused > 0 ? `${unsaved} could not be saved. ${are} kept on this device. Tell the operator. ` : "";

  if (waiting > 0) return `${kept}Please keep this page open. Some of what you said is still being saved.`;
  return kept.trim() || "Everything you said is saved.";
}

/** Why something was not sent, if no server answered. */
export const NO_CONNECTION = "No connection. This page keeps trying.";

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
    comments > 0 && counted(comments, "comment"),
    recordings > 0 && counted(recordings, "recording"),
  ];
  const where = durable ? "Saved here" : "Kept on this page only, so do not close it";
  const then = trouble === NO_CONNECTION ? "Sent when the network is back." : (trouble ?? "");
  return `${where}: ${what.filter(Boolean).join(", ")}. ${then}`.trim();
}
