// Draws focal power, focus metric and belief over the last seconds, on one scale of focal power from 0 (bottom) to 1
// (top).

import { makeCanvas, onResize, pixelsPerCss } from "../shared/canvas.js";

const ASKED = { colour: "#ffd166", label: "asked" };
const MEASURED = { colour: "#5cf2ff", label: "measured" };
const METRIC = { colour: "#ff9ecb", label: "metric" };
const BELIEF_COLOUR = "rgba(255, 255, 255, .7)";

/** Time span across the canvas, in seconds. */
const SECONDS = 10;

/** Width of the belief's bars at the right end, as a fraction of the whole width. */
const BELIEF_SHARE = 0.12;

/**
 * @typedef {object} Point
 * @property {number} time milliseconds
 * @property {number} asked
 * @property {number | null} measured
 * @property {number | null} metric
 */

/** The traces, drawn on their own canvas within `element`, with the legend above. */
export class Traces {
  #element;
  #context = makeCanvas("viewer-traces");
  /** @type {Point[]} */
  #points = [];
  /** @type {number[] | null} */
  #belief = null;
  /** @type {Set<"traces" | "belief">} */
  #shown = new Set();

  /** @param {HTMLElement} element */
  constructor(element) {
    this.#element = element;
    this.#context.canvas.setAttribute("aria-hidden", "true");
    element.append(this.#context.canvas);
    element.hidden = true;
    onResize(this.#context.canvas, () => this.#draw());
  }

  /**
   * Shows or hides the traces, or the belief beside them.
   *
   * @param {"traces" | "belief"} what
   * @param {boolean} on
   */
  show(what, on) {
    if (on) this.#shown.add(what);
    else this.#shown.delete(what);
    this.#element.hidden = this.#shown.size === 0;
    this.#draw();
  }

  /**
   * Adds the values of a frame that was exposed at `time` (milliseconds). During a session frames carry no values, and
   * the traces are cleared.
   *
   * @param {Stream.Header} header
   * @param {number} time
   */
  add({ asked = null, measured = null, metric = null, belief = null }, time) {
    if (asked === null) {
      this.#points = [];
      this.#draw();
      return;
    }
    this.#belief = belief;
    this.#points.push({ time, asked, measured, metric });
    const kept = this.#points.findIndex((point) => point.time > time - SECONDS * 1000);
    this.#points.splice(0, kept);
    this.#draw();
  }

  #draw() {
    const { width, height } = this.#context.canvas;
    this.#context.clearRect(0, 0, width, height);
    const last = this.#points.at(-1);
    if (this.#shown.size === 0 || !last) return;

    const dpr = pixelsPerCss(this.#context.canvas);
    const line = 1.5 * dpr;
    const top = 20 * dpr;
    const right = width * (1 - BELIEF_SHARE);
    const x = (/** @type {Point} */ { time }) => right * (1 - (last.time - time) / (SECONDS * 1000));
    const y = (/** @type {number} */ share) => height - line - (height - top - 2 * line) * share;
    const greatest = this.#points.reduce((most, { metric }) => Math.max(most, metric ?? 0), 1e-9);

    this.#trace(METRIC.colour, line, x, ({ metric }) => (metric === null ? null : y(metric / greatest)));
    this.#trace(MEASURED.colour, line, x, ({ measured }) => (measured === null ? null : y(measured)));
    this.#trace(ASKED.colour, line, x, ({ asked }) => y(asked));
    this.#legend(last, dpr);
    if (this.#shown.has("belief") && this.#belief) this.#bars(this.#belief, right, y, dpr);
  }

  /**
   * @param {string} colour
   * @param {number} line
   * @param {(point: Point) => number} x
   * @param {(point: Point) => number | null} y null if there is nothing to draw for a point
   */
  #trace(colour, line, x, y) {
    const context = this.#context;
    Object.assign(context, { strokeStyle: colour, lineWidth: line, lineJoin: "round" });
    context.beginPath();
    let drawing = false;
    for (const point of this.#points) {
      const height = y(point);
      if (height !== null) {
        if (drawing) context.lineTo(x(point), height);
        else context.moveTo(x(point), height);
      }
      drawing = height !== null;
    }
    context.stroke();
  }

  /**
   * @param {Point} last
   * @param {number} dpr
   */
  #legend({ asked, measured, metric }, dpr) {
    const context = this.#context;
    Object.assign(context, { font: `${12 * dpr}px system-ui, sans-serif`, textBaseline: "top" });
    const entries = [
      { ...ASKED, value: asked },
      { ...MEASURED, value: measured },
      { ...METRIC, value: metric },
    ];
    for (const [index, { colour, label, value }] of entries.entries()) {
      context.fillStyle = colour;
      const text = `${label} ${value === null ? "–" : value.toPrecision(3)}`;
      context.fillText(text, (8 + 120 * index) * dpr, 4 * dpr);
    }
  }

  /**
   * @param {number[]} belief
   * @param {number} left
   * @param {(share: number) => number} y
   * @param {number} dpr
   */
  #bars(belief, left, y, dpr) {
    const context = this.#context;
    const longest = context.canvas.width - left;
    const greatest = Math.max(...belief, 1e-9);
    context.fillStyle = BELIEF_COLOUR;
    // Value k of n is the probability of focal power k / (n - 1). Its bar is centred there; the outer bars are cut in half.
    const steps = Math.max(belief.length - 1, 1);
    for (const [bin, probability] of belief.entries()) {
      const from = y(Math.min((bin + 0.5) / steps, 1));
      const to = y(Math.max((bin - 0.5) / steps, 0));
      context.fillRect(
        left,
        from,
        (probability / greatest) * longest,
        Math.max(to - from - dpr / 2, dpr / 2),
      );
    }
  }
}
