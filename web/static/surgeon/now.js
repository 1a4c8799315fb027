// One line that says what the surgeon can do now. It is derived from the session's state and from what is not saved
// yet, so it is the same for every policy.

import { minuteText } from "../shared/text.js";

/** @typedef {Api.SurgeonView} View */

/**
 * The facts from which the line is derived.
 *
 * @typedef {object} Facts
 * @property {View | null} view
 * @property {boolean} known whether it is known which session, if any, is under way
 * @property {boolean} missed whether the server has been silent for too long
 * @property {number | null} heardAt when it was last heard, in milliseconds since 1970
 * @property {boolean} refused whether the server's certificate has ended, so that the browser refuses it
 * @property {boolean} unsent whether there is a comment in the box
 * @property {boolean} unsaved whether any comment or answer is not saved yet
 * @property {boolean} soon whether the setting's time ends in a moment
 * @property {boolean} over whether this tablet's link has ended; `view` is then the end of its session, or null
 */

/** @param {Facts} facts */
export function nowWords({ view, known, missed, heardAt, refused, unsent, unsaved, soon, over }) {
  if (over && view !== null) return endWords(view, unsent, unsaved);
  if (over) return unsaved ? KEEP_OPEN : "Scan the operator’s code to open the next session.";
  if (missed) return unreachableWords(view, heardAt, refused);
  if (!known) return "Connecting to the server…";
  if (view === null) return "Nothing to do yet: wait for the operator to start a trial.";
  if (view.phase === "completed" || view.phase === "aborted") return endWords(view, unsent, unsaved);
  if (view.paused) {
    return view.may_resume
      ? "Press “Continue” when you are ready."
      : "Wait for the operator. You can still comment.";
  }

  switch (view.phase) {
    case "ready":
      return "Wait for the operator to start the trial.";
    case "notice":
      return `Tap to begin setting ${view.setting}.`;
    case "inspecting":
      if (soon) return "This setting ends in a moment. What you are writing stays.";
      return `Look around and ${view.voice ? "say or write" : "write"} what you notice. Then finish the setting.`;
    case "questions":
      return "Answer the questions, then press “Continue”.";
    case "closing":
      return "Answer the last questions, then press “Finish”.";
  }
}

const KEEP_OPEN = "Keep this page open until everything is saved.";

/**
 * @param {View} view
 * @param {boolean} unsent
 * @param {boolean} unsaved
 */
function endWords(view, unsent, unsaved) {
  if (unsent) return "Save or delete the comment in the box.";
  if (unsaved) return KEEP_OPEN;
  return view.practice
    ? "Practice is over. Keep the tablet: the trial comes next."
    : "You are done. Give the tablet back.";
}

/**
 * @param {View | null} view
 * @param {number | null} heardAt
 * @param {boolean} refused
 */
function unreachableWords(view, heardAt, refused) {
  const since =
    heardAt === null ? "The server cannot be reached." : `No server since ${minuteText(heardAt)}.`;
  const why = refused ? `${since} Its certificate has ended: tell the operator.` : since;
  return view === null
    ? `${why} This page keeps trying.`
    : `${why} Comments are saved here and sent later.`;
}
