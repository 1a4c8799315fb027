// Forms for workload indices, and for a ranking in which settings may share a place.

import { make } from "../shared/dom.js";
import { say } from "../shared/language.js";
import { drawScale, drawWords } from "./choices.js";
import { drawTrack } from "./track.js";

/** @typedef {import("./question_form.js").Drawn} Drawn */

/** Number of gradations of a workload scale: 0 to 100 in steps of 5. */
const GRADATIONS = 21;

/**
 * @param {import("./questions.js").WorkloadAnswer} answer
 * @param {HTMLElement} heading
 * @param {() => void} changed
 * @returns {Drawn}
 */
export function drawWorkload(answer, heading, changed) {
  const choose = (/** @type {number} */ item, /** @type {number} */ point) => {
    answer.choose(item, point);
    changed();
  };

  const scales = answer.scales.map(({ title, text, low, high }, item) => {
    const inWords = (/** @type {number} */ value) => say("gradation", { value: (value - 1) * 5 });
    const line = { label: title, low, high, min: 1, max: GRADATIONS, graded: true, inWords };
    const track = drawTrack(line, (value) => choose(item, value));
    const about = make("p", { className: "about" }, text);
    return {
      element: make("fieldset", {}, make("legend", {}, title), about, track.element, gap()),
      show: track.show,
    };
  });

  const pairs = answer.pairs.map(({ first, second }, index) => {
    const item = scales.length + index;
    const names = [first, second].map((place) => answer.scales[place]?.title ?? "");
    const choices = drawWords(`${answer.question.id}-${item}`, names, (point) => choose(item, point), "pair");
    const label = say("pair-label", { first: names[0] ?? "", second: names[1] ?? "" });
    return {
      element: make("fieldset", { "aria-label": label }, choices.element, gap()),
      show: choices.check,
    };
  });

  const items = [...scales, ...pairs];
  const compare = make("p", { className: "about" }, say("pair-choose"));
  return {
    nodes: [
      heading,
      make(
        "div",
        { className: "sus" },
        ...scales.map(({ element }) => element),
        pairs.length > 0 && compare,
        ...pairs.map(({ element }) => element),
      ),
    ],
    draw: () => {
      for (const [item, { element, show }] of items.entries()) {
        show(answer.points[item] || null);
        element.classList.toggle("wanting", answer.wantedParts[item] ?? false);
      }
    },
    wantedPart: () => items.find((_, item) => answer.wantedParts[item])?.element,
  };
}

/**
 * @param {import("./questions.js").PlacesAnswer} answer
 * @param {HTMLElement} heading
 * @param {() => void} changed
 * @returns {Drawn}
 */
export function drawPlaces(answer, heading, changed) {
  const ends = { points: answer.points.length, low: say("best"), high: say("worst") };
  const settings = answer.points.map((_, item) => {
    const scale = drawScale(`${answer.question.id}-${item}`, ends, (place) => {
      answer.choose(item, place);
      changed();
    });
    const element = make(
      "fieldset",
      {},
      make("legend", {}, say("setting-number", { setting: item + 1 })),
      scale.element,
    );
    return { element, check: scale.check };
  });

  const about = make("p", { className: "about" }, say("give-places"));
  return {
    nodes: [
      heading,
      make("div", { className: "sus places" }, about, ...settings.map(({ element }) => element)),
    ],
    draw: () => {
      for (const [item, { element, check }] of settings.entries()) {
        check(answer.points[item] || null);
        element.classList.toggle("wanting", answer.wantedParts[item] ?? false);
      }
    },
    wantedPart: () => settings.find((_, item) => answer.wantedParts[item])?.element,
  };
}

/** The mark of an unanswered item. It always takes up its space. */
function gap() {
  return make("span", { className: "gap" }, say("not-answered"));
}
