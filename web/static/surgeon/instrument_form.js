// Forms of questions that have several items: the System Usability Scale, workload indices, and a ranking in which
// settings may share a place.

import { make } from "../shared/dom.js";
import { say } from "../shared/language.js";
import { drawScale, drawWords } from "./choices.js";
import { drawTrack } from "./track.js";

/** Number of gradations of a workload scale: 0 to 100 in steps of 5. */
const GRADATIONS = 21;

/** @typedef {import("./choices.js").Choices} Item */
/** @typedef {(item: number) => (point: number) => void} Choose returns the function that gives an item its point */

/**
 * The items of a form, and all that it shows, in order.
 *
 * @typedef {{ className: string, nodes: (HTMLElement | false)[], items: Item[] }} Form
 */

/**
 * @param {import("./questions.js").ItemsAnswer} answer
 * @param {HTMLElement} heading
 * @param {() => void} changed
 * @returns {import("./question_form.js").Drawn}
 */
export function drawItems(answer, heading, changed) {
  const { className, nodes, items } = formOf(answer, (item) => (point) => {
    answer.choose(item, point);
    changed();
  });

  return {
    nodes: [heading, make("div", { className }, ...nodes)],
    draw: () => {
      for (const [item, { element, check }] of items.entries()) {
        check(answer.points[item] || null);
        element.classList.toggle("wanting", answer.wantedParts[item] ?? false);
      }
    },
    wantedPart: () => items.find((_, item) => answer.wantedParts[item])?.element,
  };
}

/**
 * @param {import("./questions.js").ItemsAnswer} answer
 * @param {Choose} choose
 * @returns {Form}
 */
function formOf({ question, points }, choose) {
  switch (question.kind) {
    case "sus":
      return usability(question.id, question, choose);
    case "nasa-tlx":
      return workload(question.id, question.scales, [], choose);
    case "surg-tlx":
      return workload(question.id, question.scales, question.pairs, choose);
    default:
      return places(question.id, points.length, choose);
  }
}

/**
 * @param {string} id
 * @param {{ items: string[], low: string, high: string }} scale
 * @param {Choose} choose
 * @returns {Form}
 */
function usability(id, { items: texts, low, high }, choose) {
  const items = texts.map((text, item) => {
    const { element, check } = drawScale(`${id}-${item}`, { points: 5, low, high }, choose(item));
    return { element: make("fieldset", {}, make("legend", {}, `${item + 1}. ${text}`), element), check };
  });
  return { className: "sus", nodes: items.map(({ element }) => element), items };
}

/**
 * @param {string} id
 * @param {Api.Scale[]} scales
 * @param {Api.Pair[]} pairs
 * @param {Choose} choose
 * @returns {Form}
 */
function workload(id, scales, pairs, choose) {
  const rated = scales.map(({ title, text, low, high }, item) => {
    const inWords = (/** @type {number} */ value) => say("gradation", { value: (value - 1) * 5 });
    const line = { label: title, low, high, min: 1, max: GRADATIONS, graded: true, inWords };
    const track = drawTrack(line, choose(item));
    const about = make("p", { className: "about" }, text);
    const element = make("fieldset", {}, make("legend", {}, title), about, track.element, gap());
    return { element, check: track.show };
  });

  const compared = pairs.map(({ first, second }, index) => {
    const item = scales.length + index;
    const names = [first, second].map((place) => scales[place]?.title ?? "");
    const { element, check } = drawWords(`${id}-${item}`, names, choose(item), "pair");
    const label = say("pair-label", { first: names[0] ?? "", second: names[1] ?? "" });
    return { element: make("fieldset", { "aria-label": label }, element, gap()), check };
  });

  const compare = pairs.length > 0 && make("p", { className: "about" }, say("pair-choose"));
  const nodes = [...rated.map(({ element }) => element), compare, ...compared.map(({ element }) => element)];
  return { className: "sus", nodes, items: [...rated, ...compared] };
}

/**
 * @param {string} id
 * @param {number} settings how many there are
 * @param {Choose} choose
 * @returns {Form}
 */
function places(id, settings, choose) {
  const ends = { points: settings, low: say("best"), high: say("worst") };
  const items = Array.from({ length: settings }, (_, item) => {
    const { element, check } = drawScale(`${id}-${item}`, ends, choose(item));
    const legend = make("legend", {}, say("setting-number", { setting: item + 1 }));
    return { element: make("fieldset", {}, legend, element), check };
  });

  const about = make("p", { className: "about" }, say("give-places"));
  return { className: "sus places", nodes: [about, ...items.map(({ element }) => element)], items };
}

/** The mark of an unanswered item. It always takes up its space. */
function gap() {
  return make("span", { className: "gap" }, say("not-answered"));
}
