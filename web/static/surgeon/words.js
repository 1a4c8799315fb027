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

/**
 * @param {View | null} state
 * @param {number | null} seconds left of the setting's time; null if it has no limit
 */
export function timeLeft(state, seconds) {
  if (state?.phase !== "inspecting" || seconds === null) return "";
  return state.paused ? "Paused" : `${clockText(seconds, Math.ceil)} left`;
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

/**
 * Says where something is kept that the server does not have yet.
 *
 * @param {string} what such as `2 comments`
 * @param {boolean} durable whether this device keeps it over a reload
 */
export function heldWords(what, durable) {
  return durable
    ? `Saved here, not sent yet: ${what}.`
    : `Kept on this page only, so do not close it: ${what}.`;
}
