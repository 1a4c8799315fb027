// A line on which a place can be marked: by touching it, by dragging, with the buttons beside it, or with keys. Nothing
// is marked until the surgeon marks it.

import { make } from "../shared/dom.js";
import { say, words } from "../shared/language.js";

/**
 * @typedef {object} Line
 * @property {string} label the question, for a screen reader
 * @property {string} low the meaning of the lower end
 * @property {string} high the meaning of the upper end
 * @property {number} min
 * @property {number} max
 * @property {boolean} graded whether every value has a tick
 * @property {(value: number) => string} inWords a value as text for a screen reader
 */

/**
 * The value at `fraction` of the line: 0 is its lower end, 1 its upper end.
 *
 * @param {Pick<Line, "min" | "max">} line
 * @param {number} fraction
 */
export function valueAt({ min, max }, fraction) {
  const within = Math.min(Math.max(fraction, 0), 1);
  return min + Math.round(within * (max - min));
}

/**
 * The value after `key` was pressed; null if the key moves nothing. A line without a mark starts in its middle.
 *
 * @param {Pick<Line, "min" | "max">} line
 * @param {number | null} value
 * @param {string} key
 */
export function valueAfter({ min, max }, value, key) {
  /** @type {Record<string, number>} */
  const steps = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 };
  if (key === "Home") return min;
  if (key === "End") return max;
  const step = steps[key];
  if (step === undefined) return null;
  if (value === null) return Math.round((min + max) / 2);
  return Math.min(Math.max(value + step, min), max);
}

/**
 * Draws a line. Calls `mark` when the surgeon has marked a place.
 *
 * @param {Line} line
 * @param {(value: number) => void} mark
 */
export function drawTrack(line, mark) {
  const { min, max } = line;
  /** The marked value; null if nothing is marked. @type {number | null} */
  let value = null;
  /** The value under the finger while it drags. @type {number | null} */
  let dragged = null;

  const thumb = make("span", { className: "thumb", "aria-hidden": "true" });
  const ticks = make("span", { className: "ticks", "aria-hidden": "true" });
  if (line.graded) {
    for (let tick = min; tick <= max; tick += 1) ticks.append(make("span", {}));
  }
  const rail = make("span", { className: "rail", "aria-hidden": "true" }, ticks, thumb);
  const slider = make(
    "div",
    {
      className: "track",
      role: "slider",
      tabIndex: 0,
      "aria-label": line.label,
      "aria-valuemin": String(min),
      "aria-valuemax": String(max),
    },
    rail,
  );

  const less = stepper("−", say("line-less", { low: words(line.low) }), "ArrowLeft");
  const more = stepper("+", say("line-more", { high: words(line.high) }), "ArrowRight");

  /**
   * @param {string} sign
   * @param {string} label
   * @param {string} key the key that does the same
   */
  function stepper(sign, label, key) {
    const button = make("button", { type: "button", className: "step", "aria-label": label }, sign);
    button.onclick = () => press(key);
    return button;
  }

  /** @param {string} key */
  function press(key) {
    const next = valueAfter(line, value, key);
    if (next === null) return false;
    if (next !== value) mark(next);
    return true;
  }

  /** @param {PointerEvent} event */
  function under(event) {
    const { left, width } = rail.getBoundingClientRect();
    return valueAt(line, (event.clientX - left) / width);
  }

  function draw() {
    const shown = dragged ?? value;
    thumb.hidden = shown === null;
    slider.classList.toggle("marked", shown !== null);
    less.disabled = value === null;
    more.disabled = value === null;
    if (shown === null) {
      slider.removeAttribute("aria-valuenow");
      slider.setAttribute("aria-valuetext", say("not-marked"));
      return;
    }
    thumb.style.left = `${(100 * (shown - min)) / (max - min)}%`;
    slider.setAttribute("aria-valuenow", String(shown));
    slider.setAttribute("aria-valuetext", line.inWords(shown));
  }

  slider.addEventListener("pointerdown", (event) => {
    if (!event.isPrimary || event.button !== 0) return;
    slider.setPointerCapture(event.pointerId);
    dragged = under(event);
    draw();
  });
  slider.addEventListener("pointermove", (event) => {
    if (dragged === null) return;
    dragged = under(event);
    draw();
  });
  slider.addEventListener("pointerup", (event) => {
    if (dragged === null) return;
    const marked = under(event);
    dragged = null;
    mark(marked);
    draw();
  });
  // The finger scrolls the page, so no mark was meant.
  slider.addEventListener("pointercancel", () => {
    dragged = null;
    draw();
  });
  slider.addEventListener("keydown", (event) => {
    if (press(event.key)) event.preventDefault();
  });

  draw();
  return {
    element: make(
      "div",
      { className: "line" },
      make("div", { className: "row" }, less, slider, more),
      make(
        "div",
        { className: "ends", "aria-hidden": "true" },
        make("span", { dir: "auto" }, line.low),
        make("span", { dir: "auto" }, line.high),
      ),
    ),
    /** @param {number | null} marked */
    show(marked) {
      value = marked;
      draw();
    },
  };
}
