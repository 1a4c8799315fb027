// The session's texts for the operator: its phase, its steps, what can be done with it.

import { clockText } from "../shared/text.js";

/** @typedef {Api.OperatorView} View */
/** @typedef {"start" | "resume" | "end-setting" | "pause" | "dismiss" | "abort" | "consent" | "withdraw"} Deed */

/** @param {View} view */
export function isOver({ phase }) {
  return phase === "completed" || phase === "aborted";
}

/** @param {View} view whether the session has started and not ended */
export function isUnderWay(view) {
  return view.phase !== "ready" && !isOver(view);
}

/** @param {View} view */
export function phaseWords(view) {
  const { phase, setting, settings } = view;
  const which = `Setting ${setting} of ${settings}`;
  switch (phase) {
    case "ready":
      return lacksConsent(view) ? "Consent is missing" : "Ready to start";
    case "notice":
      return `${which}: waiting for the surgeon to tap`;
    case "inspecting":
      return `${which}: inspecting`;
    case "questions":
      return `${which}: questions`;
    case "closing":
      return "Closing questions";
    case "completed":
      return "Completed";
    case "aborted":
      return "Aborted";
  }
}

/**
 * The state of each setting, in order; empty for a setting that is still to come.
 *
 * @param {View} view
 * @returns {("done" | "now" | "")[]}
 */
export function steps({ phase, setting, settings }) {
  return Array.from({ length: settings }, (_, index) => {
    const number = index + 1;
    if (number < setting || phase === "completed" || phase === "closing") return "done";
    return number === setting ? "now" : "";
  });
}

/**
 * @param {View} view
 * @param {number | null} seconds left of the setting's time; null if it has no limit
 */
export function timeLeft({ phase, paused }, seconds) {
  if (phase !== "inspecting" || seconds === null) return "";
  return paused ? "clock stopped" : `${clockText(seconds, Math.ceil)} left`;
}

/**
 * Whether the session waits for the participant's consent.
 *
 * @param {View} view
 */
export function lacksConsent({ consent, consent_required: required }) {
  return required != null && consent?.text_version !== required;
}

/**
 * Says what is known about the participant's consent or withdrawal; empty if there is nothing to say.
 *
 * @param {View} view
 */
export function consentWords(view) {
  const { consent, consent_required: required, withdrawn } = view;
  if (withdrawn) return "The participant withdrew. The data of this session stay out of exports.";
  if (lacksConsent(view)) {
    return `The protocol requires the participant’s consent to version ${required} of the text. Record it before the start.`;
  }
  if (!consent) return "";
  const { text_version: version, medium, given_on: day, obtained_by: by } = consent;
  return `Consent to version ${version} of the text, on ${medium}, given on ${day}, obtained by ${by}.`;
}

/**
 * The buttons, in order.
 *
 * @param {View} view
 * @returns {{ deed: Deed, label: string, className: "" | "primary" | "danger" | "danger filled" }[]}
 */
export function deeds(view) {
  const { phase, paused, setting, withdrawn } = view;
  /** @type {ReturnType<typeof deeds>} */
  const all = [];

  if (phase === "ready") {
    const missing = lacksConsent(view);
    if (missing || !view.consent) {
      all.push({ deed: "consent", label: "Record consent…", className: missing ? "primary" : "" });
    }
    if (!missing) all.push({ deed: "start", label: "Start", className: "primary" });
  }
  // The pause comes first and asks nothing: in an emergency one tap has to do.
  if (!paused && phase !== "ready" && !isOver(view)) {
    all.push({ deed: "pause", label: "Pause", className: "danger filled" });
  }
  if (paused) all.push({ deed: "resume", label: "Resume", className: "primary" });
  else if (phase === "inspecting") {
    all.push({ deed: "end-setting", label: `End setting ${setting} now…`, className: "" });
  }

  if (isOver(view)) {
    all.push({ deed: "dismiss", label: "Close and prepare the next", className: "primary" });
    if (!withdrawn) all.push({ deed: "withdraw", label: "Participant withdraws…", className: "danger" });
  } else all.push({ deed: "abort", label: "Abort…", className: "danger" });
  return all;
}

/**
 * Asks for the reason of a pause that has none yet.
 *
 * @param {string} clock when the session was paused, such as `14:03:20`
 * @param {View["reason_wanted"]} wanted
 */
export function reasonWords(clock, wanted) {
  if (!wanted) return "";
  const who = wanted.by === "surgeon" ? "the surgeon" : "you";
  return `Why ${who} paused at ${clock}, if it should be in the record`;
}

/**
 * Says that the lens was stopped before this could be recorded, and what will happen; empty if everything is recorded.
 *
 * @param {View} view
 */
export function unrecordedWords({ unrecorded, unrecorded_because: because }) {
  if (!unrecorded) return "";
  const why = because ?? "the disk has not answered";
  const then = "The server keeps trying. If it stops first, the session will be paused when it starts again.";
  return `The lens is held, but this is not recorded yet: ${why}. ${then}`;
}

/** @param {Api.CommentLine} comment */
export function commentWords(comment) {
  // Nobody sends an empty comment, so the text was erased.
  if (comment.kind === "mark") return "Marked this moment";
  if (comment.kind === "voice") return "Voice comment";
  if (comment.text === "") return "Erased";
  return comment.kind === "quick" ? `${comment.text} (quick)` : comment.text;
}

/** @param {Api.Choices["protocols"][number]} protocol */
export function protocolWords({ researcher_title: title, settings, segment_seconds: seconds, practice }) {
  const length = `${title}: ${settings} settings of at most ${clockText(seconds)}`;
  return practice ? `${length}. This is practice, kept apart from real data.` : `${length}.`;
}

/**
 * Protocols in the order in which they are offered: practice first, so that the real trial is never the nearest.
 *
 * @template {{ practice: boolean }} Protocol
 * @param {Protocol[]} protocols
 */
export function practiceFirst(protocols) {
  return [...protocols].sort((a, b) => Number(b.practice) - Number(a.practice));
}

/**
 * A code as it was meant: `s01` is S01. What has no digit may be a name, which is never taken.
 *
 * @param {string} typed
 */
export function asCode(typed) {
  return /\d/.test(typed) ? typed.toUpperCase() : typed;
}
