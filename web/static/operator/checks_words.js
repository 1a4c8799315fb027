// The texts that say whether everything is ready for a trial.

import { counted } from "../shared/text.js";

/** @typedef {Api.Schemas["Finding"]} Finding */

/** How each verdict is shown, and what a screen reader says. The most serious comes first. */
const VERDICTS = /** @type {const} */ ([
  { verdict: "wrong", mark: "✗", words: "Put this right first", level: "bad" },
  { verdict: "advice", mark: "!", words: "Look at this", level: "warn" },
  { verdict: "well", mark: "✓", words: "Ready", level: "good" },
]);

/** @param {Finding} finding */
export function shown({ verdict }) {
  return VERDICTS.find((one) => one.verdict === verdict) ?? VERDICTS[0];
}

/**
 * Splits the findings into those that need attention, the most serious first, and those that do not.
 *
 * @param {Finding[]} findings
 */
export function sorted(findings) {
  const of = (/** @type {string} */ wanted) => findings.filter(({ verdict }) => verdict === wanted);
  return { open: [...of("wrong"), ...of("advice")], well: of("well") };
}

/**
 * All findings in one sentence.
 *
 * @param {Finding[]} findings
 */
export function summary(findings) {
  const count = (/** @type {string} */ wanted) => findings.filter(({ verdict }) => verdict === wanted).length;
  const wrong = count("wrong");
  const advice = count("advice");

  if (wrong > 0) return `${counted(wrong, "thing")} to fix before a trial.`;
  if (advice > 0) return `A trial can run. ${counted(advice, "thing")} to look at.`;
  return "Everything is ready.";
}

/**
 * The title of the list of checks that passed.
 *
 * @param {number} number
 */
export function passed(number) {
  return `${counted(number, "check")} passed`;
}

/**
 * A subject with a capital letter, to begin a line.
 *
 * @param {string} subject
 */
export function heading(subject) {
  return subject.charAt(0).toUpperCase() + subject.slice(1);
}
