// Texts for corrections: how an answer is written into a field and read back, and the hints beside the field.

/** @typedef {Api.SessionDetail["answers"][number]} AnswerLine */

/** Kinds whose answer is one number. */
const NUMBERS = ["likert", "visual-analogue", "recognition"];

/**
 * The answers that can be corrected. A surgeon's own words cannot.
 *
 * @param {AnswerLine[]} answers
 */
export function correctable(answers) {
  return answers.filter(({ value }) => typeof value !== "string");
}

/**
 * The name of an answer in a list: its setting and its question.
 *
 * @param {Pick<AnswerLine, "setting" | "text" | "question">} answer
 */
export function answerName({ setting, text, question }) {
  const where = setting == null ? "Closing" : `Setting ${setting}`;
  return `${where}: ${text || question}`;
}

/**
 * The present answer, with its correction if there is one.
 *
 * @param {Pick<AnswerLine, "value" | "corrected">} answer
 * @returns {Api.AnswerValue}
 */
export function soFar({ value, corrected }) {
  return corrected ?? value;
}

/**
 * An answer as text for the field.
 *
 * @param {Api.AnswerValue} value
 */
export function written(value) {
  return Array.isArray(value) ? value.join(", ") : String(value);
}

/**
 * Reads the answer to a question of `kind` from the field's text; null if it is not an answer.
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
 * Says what the field accepts for a question of `kind`.
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
      return "In the same form as now: numbers separated by commas.";
    case "sus":
      return "The ten points from 1 to 5, separated by commas.";
    case "nasa-tlx":
    case "surg-tlx":
      return "The gradation of each scale, from 1 (rating 0) to 21 (rating 100), separated by commas; then 1 or 2 for each pair.";
    default:
      return "Numbers separated by commas.";
  }
}
