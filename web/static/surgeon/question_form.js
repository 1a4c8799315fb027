// Draws the questions as a form.

import { make, setText } from "../shared/dom.js";
import { say, words } from "../shared/language.js";
import { drawScale, drawWords } from "./choices.js";
import { drawItems } from "./instrument_form.js";
import { ItemsAnswer, ScaleAnswer, TextAnswer } from "./questions.js";
import { drawRanking } from "./ranking.js";
import { drawTrack } from "./track.js";

/** @typedef {import("./questions.js").AnyAnswer} AnyAnswer */

/** The labels for whether settings were recognised. The values count from 1. */
const recognition = () => [say("no"), say("not-sure"), say("yes")];

/**
 * One question's element. `draw` shows the answer's state. `wantedPlace` returns the first place that is still to be
 * answered.
 *
 * @typedef {object} QuestionBox
 * @property {AnyAnswer} answer
 * @property {HTMLFieldSetElement} element
 * @property {() => void} draw
 * @property {() => boolean} isBusy whether the surgeon is writing in its field
 * @property {() => HTMLElement} wantedPlace
 */

/**
 * The parts of a question that depend on its kind.
 *
 * @typedef {object} Drawn
 * @property {HTMLElement[]} nodes
 * @property {() => void} draw
 * @property {() => boolean} [isBusy]
 * @property {() => HTMLElement | undefined} [wantedPart]
 */

/**
 * Draws a question. `changed` is called after the surgeon has changed the answer.
 *
 * @param {AnyAnswer} answer
 * @param {() => void} changed
 * @returns {QuestionBox}
 */
export function questionBox(answer, changed) {
  const status = make("p", { className: "state", role: "status" });
  const afterChange = () => {
    draw();
    changed();
  };
  const drawn = drawKind(answer, afterChange);
  const element = make(
    "fieldset",
    { className: "question", "data-question": answer.question.id },
    ...drawn.nodes,
    status,
  );

  function draw() {
    drawn.draw();
    element.classList.toggle("wanting", answer.wanted);
    status.className = `state ${answer.reached}`;
    setText(status, answer.status);
  }

  answer.changed = afterChange;
  draw();
  return {
    answer,
    element,
    draw,
    isBusy: drawn.isBusy ?? (() => false),
    wantedPlace: () => drawn.wantedPart?.() ?? element,
  };
}

/**
 * @param {AnyAnswer} answer
 * @param {() => void} changed
 * @returns {Drawn}
 */
function drawKind(answer, changed) {
  if (answer instanceof TextAnswer) return drawText(answer, changed);
  if (answer instanceof ScaleAnswer) return drawScaleQuestion(answer, changed);
  if (answer instanceof ItemsAnswer) return drawItems(answer, heading(answer.question), changed);
  return drawRanking(answer, heading(answer.question), changed);
}

/** @param {Api.Question} question */
function heading(question) {
  const optional = question.optional && make("span", { className: "optional" }, ` ${say("optional")}`);
  return make("legend", { className: "ask", id: `ask-${question.id}`, dir: "auto" }, question.text, optional);
}

/**
 * @param {TextAnswer} answer
 * @param {() => void} changed
 * @returns {Drawn}
 */
function drawText(answer, changed) {
  const area = make("textarea", { rows: 3, dir: "auto", "aria-labelledby": `ask-${answer.question.id}` });
  area.addEventListener("input", () => {
    answer.write(area.value);
    changed();
  });
  area.addEventListener("change", () => {
    answer.giveNow();
    changed();
  });

  return {
    nodes: [heading(answer.question), area],
    draw: () => {
      if (area.value !== answer.text) area.value = answer.text;
    },
    isBusy: () => document.activeElement === area,
  };
}

/**
 * @param {ScaleAnswer} answer
 * @param {() => void} changed
 * @returns {Drawn}
 */
function drawScaleQuestion(answer, changed) {
  const { question } = answer;
  const { element, check } = drawPoints(question, (point) => {
    answer.choose(point);
    changed();
  });
  return { nodes: [heading(question), element], draw: () => check(answer.point) };
}

/**
 * Draws the input of a question whose answer is one number.
 *
 * @param {Api.Question} question
 * @param {(point: number) => void} choose
 * @returns {import("./choices.js").Choices}
 */
function drawPoints(question, choose) {
  switch (question.kind) {
    case "likert":
      return question.labels?.length
        ? drawWords(question.id, question.labels, choose, "column")
        : drawScale(question.id, question, choose);
    case "recognition":
      return drawWords(question.id, recognition(), choose);
    case "visual-analogue": {
      const { low, high, text } = question;
      const ends = { low: words(low), high: words(high) };
      const inWords = (/** @type {number} */ value) => say("line-value", { value, ...ends });
      const track = drawTrack({ label: text, low, high, min: 0, max: 100, graded: false, inWords }, choose);
      return { element: track.element, check: track.show };
    }
    default:
      throw new Error(`question ${question.id} has no scale`);
  }
}
