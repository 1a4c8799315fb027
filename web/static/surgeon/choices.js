// Radio buttons for the questions: a scale of numbers, or a few choices in words.

import { make } from "../shared/dom.js";
import { say, words } from "../shared/language.js";

/**
 * @typedef {object} Choices
 * @property {HTMLElement} element
 * @property {(point: number | null) => void} check shows which button is chosen, counted from 1; null for none
 */

/**
 * Radio buttons from 1 to `points`, with the meanings of both ends.
 *
 * @param {string} name
 * @param {{ points: number, low: string, high: string }} ends
 * @param {(point: number) => void} choose
 * @returns {Choices}
 */
export function drawScale(name, { points, low, high }, choose) {
  // The mark always takes up its space, so that nothing moves when it appears or disappears.
  const ends = make(
    "div",
    { className: "ends" },
    make("span", { "aria-hidden": "true", dir: "auto" }, low),
    make("span", { className: "gap" }, say("not-answered")),
    make("span", { "aria-hidden": "true", dir: "auto" }, high),
  );

  const inputs = Array.from({ length: points }, (_, index) => {
    const point = index + 1;
    const meaning = point === 1 ? low : point === points ? high : null;
    const label =
      meaning === null
        ? say("scale-point", { point, points })
        : say("scale-end", { point, points, meaning: words(meaning) });
    const input = make("input", { type: "radio", name, value: String(point), "aria-label": label });
    input.addEventListener("change", () => choose(point));
    return input;
  });
  const labels = inputs.map((input) =>
    make("label", {}, input, make("span", { "aria-hidden": "true" }, input.value)),
  );

  return {
    element: make("div", { className: "likert" }, make("div", { className: "points" }, ...labels), ends),
    check: (point) => check(inputs, point),
  };
}

/**
 * Radio buttons with words on them.
 *
 * @param {string} name
 * @param {string[]} meanings
 * @param {(point: number) => void} choose
 * @param {string} [className]
 * @returns {Choices}
 */
export function drawWords(name, meanings, choose, className = "") {
  const inputs = meanings.map((_, index) => {
    const input = make("input", { type: "radio", name, value: String(index + 1) });
    input.addEventListener("change", () => choose(index + 1));
    return input;
  });
  const labels = inputs.map((input, index) =>
    make("label", {}, input, make("span", { dir: "auto" }, meanings[index])),
  );
  return {
    element: make(
      "div",
      { className: `likert words ${className}` },
      make("div", { className: "points" }, ...labels),
    ),
    check: (point) => check(inputs, point),
  };
}

/**
 * @param {HTMLInputElement[]} inputs
 * @param {number | null} point
 */
function check(inputs, point) {
  for (const [index, input] of inputs.entries()) {
    const chosen = index + 1 === point;
    if (input.checked !== chosen) input.checked = chosen;
  }
}
