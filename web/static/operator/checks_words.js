// Whether everything is ready for a trial, in words.

/** @typedef {Api.Schemas["Finding"]} Finding */

/** How each verdict is shown, and what a screen reader says. The gravest comes first. */
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
 * The findings that need somebody, the gravest first, and those that do not.
 *
 * @param {Finding[]} findings
 */
export function sorted(findings) {
  const of = (/** @type {string} */ wanted) => findings.filter(({ verdict }) => verdict === wanted);
  return { open: [...of("wrong"), ...of("advice")], well: of("well") };
}

/**
 * What it comes to.
 *
 * @param {Finding[]} findings
 */
export function summary(findings) {
  const count = (/** @type {string} */ wanted) => findings.filter(({ verdict }) => verdict === wanted).length;
  const wrong = count("wrong");
  const advice = count("advice");

  if (wrong > 0) return `${things(wrong)} to put right before a trial.`;
  if (advice > 0) return `A trial can run. ${things(advice)} to look at.`;
  return "Everything is ready.";
}

/** @param {number} number */
function things(number) {
  return number === 1 ? "1 thing" : `${number} things`;
}

/**
 * The title of the list of what is well.
 *
 * @param {number} number
 */
export function passed(number) {
  return number === 1 ? "1 check passed" : `${number} checks passed`;
}

/**
 * A subject as the beginning of a line.
 *
 * @param {string} subject
 */
export function heading(subject) {
  return subject.charAt(0).toUpperCase() + subject.slice(1);
}
