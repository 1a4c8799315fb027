// The questions as a form.

import { make, setText } from "../shared/dom.js";
import { NOT_ANSWERED, ordinal, RankingAnswer, ScaleAnswer, SusAnswer, TextAnswer } from "./questions.js";

/** @typedef {import("./questions.js").AnyAnswer} AnyAnswer */

/**
 * One question's element; `draw` shows the answer's state, `wantedPlace` the first place still to
 * be answered.
 *
 * @typedef {object} QuestionBox
 * @property {AnyAnswer} answer
 * @property {HTMLFieldSetElement} element
 * @property {() => void} draw
 * @property {() => boolean} isBusy whether the surgeon is in its field
 * @property {() => HTMLElement} wantedPlace
 */

/**
 * What is particular to one kind of question.
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
  if (answer instanceof SusAnswer) return drawSus(answer, changed);
  return drawRanking(answer, changed);
}

/** @param {Api.Question} question */
function heading(question) {
  const optional = question.optional && make("span", { className: "optional" }, " (optional)");
  return make("legend", { className: "ask", id: `ask-${question.id}` }, question.text, optional);
}

/**
 * @param {TextAnswer} answer
 * @param {() => void} changed
 * @returns {Drawn}
 */
function drawText(answer, changed) {
  const area = make("textarea", { rows: 3, "aria-labelledby": `ask-${answer.question.id}` });
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
  if (question.kind !== "likert") throw new Error(`question ${question.id} has no scale`);
  const scale = drawScale(question.id, question, (point) => {
    answer.choose(point);
    changed();
  });
  return { nodes: [heading(question), scale.element], draw: () => scale.check(answer.point) };
}

/**
 * Radio buttons from 1 to `points`, with what the ends mean.
 *
 * @param {string} name
 * @param {{ points: number, low: string, high: string }} ends
 * @param {(point: number) => void} choose
 */
function drawScale(name, { points, low, high }, choose) {
  // Room for the mark is kept, so that nothing moves when it comes or goes.
  const ends = make(
    "div",
    { className: "ends" },
    make("span", { "aria-hidden": "true" }, low),
    make("span", { className: "gap" }, NOT_ANSWERED),
    make("span", { "aria-hidden": "true" }, high),
  );

  const inputs = Array.from({ length: points }, (_, index) => {
    const point = index + 1;
    const meaning = point === 1 ? `, ${low}` : point === points ? `, ${high}` : "";
    const label = `${point} of ${points}${meaning}`;
    const input = make("input", { type: "radio", name, value: String(point), "aria-label": label });
    input.addEventListener("change", () => choose(point));
    return input;
  });
  const labels = inputs.map((input) =>
    make("label", {}, input, make("span", { "aria-hidden": "true" }, input.value)),
  );

  return {
    element: make("div", { className: "likert" }, make("div", { className: "points" }, ...labels), ends),
    /** @param {number | null} point */
    check(point) {
      for (const [index, input] of inputs.entries()) {
        const chosen = index + 1 === point;
        if (input.checked !== chosen) input.checked = chosen;
      }
    },
  };
}

/**
 * @param {SusAnswer} answer
 * @param {() => void} changed
 * @returns {Drawn}
 */
function drawSus(answer, changed) {
  const ends = { points: 5, low: "Strongly disagree", high: "Strongly agree" };
  const scales = answer.items.map((_, item) =>
    drawScale(`${answer.question.id}-${item}`, ends, (point) => {
      answer.choose(item, point);
      changed();
    }),
  );
  const items = scales.map(({ element }, item) =>
    make("fieldset", {}, make("legend", {}, `${item + 1}. ${answer.items[item]}`), element),
  );

  return {
    nodes: [heading(answer.question), make("div", { className: "sus" }, ...items)],
    draw: () => {
      for (const [item, element] of items.entries()) {
        scales[item]?.check(answer.points[item] ?? null);
        element.classList.toggle("wanting", answer.wantedParts[item] ?? false);
      }
    },
    wantedPart: () => items.find((_, item) => answer.wantedParts[item]),
  };
}

/**
 * @param {RankingAnswer} answer
 * @param {() => void} changed
 * @returns {Drawn}
 */
function drawRanking(answer, changed) {
  const list = make("ol", { className: "ranking" });
  const heard = make("p", { className: "visually-hidden", "aria-live": "polite" });
  const confirm = make("button", { type: "button", className: "confirm" }, "This order is right");
  confirm.onclick = () => {
    answer.confirm();
    changed();
  };
  let drawnOrder = "";

  /**
   * @param {number} from
   * @param {number} to
   */
  function move(from, to) {
    const setting = answer.move(from, to);
    changed();
    const [up, down] = list.children[to]?.querySelectorAll("button") ?? [];
    const wanted = to < from ? up : down;
    (wanted?.disabled ? (wanted === up ? down : up) : wanted)?.focus();
    setText(heard, `Setting ${setting} is now in place ${to + 1} of ${answer.order.length}`);
  }

  /**
   * @param {string} label
   * @param {string} sign
   * @param {number} from
   * @param {number} to
   */
  function mover(label, sign, from, to) {
    const disabled = to < 0 || to >= answer.order.length;
    const button = make("button", { type: "button", "aria-label": label, disabled }, sign);
    button.onclick = () => move(from, to);
    return button;
  }

  function draw() {
    confirm.hidden = answer.confirmed;
    const order = JSON.stringify(answer.order);
    if (order === drawnOrder) return;
    drawnOrder = order;

    const lines = answer.order.map((setting, index) => {
      const place = `${ordinal(index + 1)}${index === 0 ? ", best" : ""}`;
      return make(
        "li",
        {},
        make("span", { className: "place" }, place),
        make("span", {}, `Setting ${setting}`),
        mover(`Move setting ${setting} up`, "↑", index, index - 1),
        mover(`Move setting ${setting} down`, "↓", index, index + 1),
      );
    });
    list.replaceChildren(...lines);
  }

  return { nodes: [heading(answer.question), list, heard, confirm], draw };
}
