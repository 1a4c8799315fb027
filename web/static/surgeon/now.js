// One line that says what the surgeon can do now. It is derived from the session's state and from what is not saved
// yet, so it is the same for every policy.

import { say } from "../shared/language.js";
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
  if (over) return unsaved ? say("now-keep-open") : say("now-scan-code");
  if (missed) return unreachableWords(view, heardAt, refused);
  if (!known) return say("now-connecting");
  if (view === null) return say("now-nothing");
  if (view.phase === "completed" || view.phase === "aborted") return endWords(view, unsent, unsaved);
  if (view.paused) {
    return view.may_resume ? say("now-press-continue") : say("now-wait-paused");
  }

  switch (view.phase) {
    case "ready":
      return say("now-wait-start");
    case "notice":
      return say("now-tap-begin", { setting: view.setting });
    case "inspecting":
      if (soon) return say("now-ends-soon");
      return view.voice ? say("now-look-say") : say("now-look-write");
    case "questions":
      return say("now-answer");
    case "closing":
      return say("now-answer-last");
  }
}

/**
 * @param {View} view
 * @param {boolean} unsent
 * @param {boolean} unsaved
 */
function endWords(view, unsent, unsaved) {
  if (unsent) return say("now-comment-left");
  if (unsaved) return say("now-keep-open");
  return view.practice ? say("now-practice-over") : say("now-done");
}

/**
 * @param {View | null} view
 * @param {number | null} heardAt
 * @param {boolean} refused
 */
function unreachableWords(view, heardAt, refused) {
  const since =
    heardAt === null ? say("now-unreachable") : say("now-silent-since", { time: minuteText(heardAt) });
  const why = refused ? [since, say("now-certificate-over")] : [since];
  return [...why, view === null ? say("now-keeps-trying") : say("now-comment-on")].join(" ");
}
