// Corrections in words: how an answer is written down and read back, and what is asked for.

/** @typedef {Api.SessionDetail["answers"][number]} AnswerLine */

/** Kinds whose answer is one number. */
const NUMBERS = ["likert", "visual-analogue", "recognition"];

/**
 * The answers that can be corrected: a surgeon's own words cannot.
 *
 * @param {AnswerLine[]} answers
 */
export function correctable(answers) {
  return answers.filter(({ value }) => typeof value !== "string");
}

/**
 * Where an answer stands and what it was asked, for a list.
 *
 * @param {Pick<AnswerLine, "setting" | "text" | "question">} answer
 */
export function answerName({ setting, text, question }) {
  const where = setting == null ? "Closing" : `Setting ${setting}`;
  return `${where}: ${text || question}`;
}

/**
 * The answer so far: as it was corrected, if it was.
 *
 * @param {Pick<AnswerLine, "value" | "corrected">} answer
 * @returns {Api.AnswerValue}
 */
export function soFar({ value, corrected }) {
  return corrected ?? value;
}

/**
 * An answer as it is written into the field.
 *
 * @param {Api.AnswerValue} value
 */
export function written(value) {
  return Array.isArray(value) ? value.join(", ") : String(value);
}

/**
 * The answer to a question of `kind` that stands in the field; null where it is none.
 *
 * @param {string | null | undefined} kind
 * @param {string} text
 * @returns {Api.AnswerValue | null}
 */
export function read(kind, text) {
  const parts = text.split(",").map((part) => part.trim());
  if (!parts.every((part) => /^\d{1,3}$/.test(part))) return null;
  const numbers = parts.map(Number);
  if (!NUMBERS.includes(kind ?? "")) return numbers;
  const [number] = numbers;
  return numbers.length === 1 && number !== undefined ? number : null;
}

/**
 * What the field takes for a question of `kind`.
 *
 * @param {string | null | undefined} kind
 */
export function hint(kind) {
  switch (kind) {
    case "likert":
      return "The number of the point, from 1.";
    case "visual-analogue":
      return "The place on the line, from 0 to 100.";
    case "recognition":
      return "1 for no, 2 for not sure, 3 for yes.";
    case "ranking":
      return "As it stands now: numbers with commas between.";
    case "sus":
      return "The ten points from 1 to 5, with commas between.";
    case "nasa-tlx":
    case "surg-tlx":
      return "The gradation of each scale, from 1 (rating 0) to 21 (rating 100), with commas between; then 1 or 2 for each pair.";
    default:
      return "Numbers with commas between.";
  }
}
