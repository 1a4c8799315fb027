// Texts about the state of a study's export.

import { counted } from "../shared/text.js";

/** Fraction of an export's time that is spent on exporting the sessions. The rest is spent on joining them. */
const EXPORTING = 0.7;

/** @param {boolean} unblinded */
function withPolicies(unblinded) {
  return unblinded ? "with policies" : "without policies";
}

/**
 * Says what the export is doing now.
 *
 * @param {Extract<Api.StudyExportState, { state: "running" }>} running
 */
export function progressWords({ progress, unblinded }) {
  const { sessions, exported, steps, joined } = progress;
  const how = withPolicies(unblinded);
  if (sessions === 0) return `The export ${how} begins.`;
  if (steps === 0) return `Exporting ${how}: ${exported} of ${counted(sessions, "session")}.`;
  return `Exporting ${how}: ${counted(sessions, "session")} done. Joining them: step ${joined} of ${steps}.`;
}

/**
 * The fraction of the export that is done, from 0 to 1.
 *
 * @param {Api.StudyExportProgress} progress
 */
export function progressShare({ sessions, exported, steps, joined }) {
  if (sessions === 0) return 0;
  if (steps === 0) return (EXPORTING * exported) / sessions;
  return EXPORTING + ((1 - EXPORTING) * joined) / steps;
}

/** @param {Extract<Api.StudyExportState, { state: "ready" }>} ready */
export function readyWords({ sessions, unblinded }) {
  const ready = `The export ${withPolicies(unblinded)} is ready: ${counted(sessions, "session")}`;
  return `${ready}. The server keeps it for an hour.`;
}

/** @param {Extract<Api.StudyExportState, { state: "failed" }>} failed */
export function failedWords({ reason, unblinded }) {
  return `The export ${withPolicies(unblinded)} failed: ${reason}`;
}
