// Focal power, focus metric and belief over the last seconds, on one scale of focal power from 0 (bottom) to 1 (top).

import { makeCanvas, onResize, pixelsPerCss } from "../shared/canvas.js";

const ASKED = { colour: "#ffd166", label: "asked" };
const MEASURED = { colour: "#5cf2ff", label: "measured" };
const METRIC = { colour: "#ff9ecb", label: "metric" };
const BELIEF_COLOUR = "rgba(255, 255, 255, .7)";

/** Seconds across. */
const SECONDS = 10;

/** Width of the belief's bars at the right end: share of the whole. */
const BELIEF_SHARE = 0.12;

/** Drawn by a canvas of its own within `element`, with the legend above. */
export class Traces {
  #context = makeCanvas("viewer-traces").getContext("2d");
  #points = [];
  #belief = null;
  #on = false;
  #beliefOn = false;

  constructor(element) {
    this.#context.canvas.setAttribute("aria-hidden", "true");
    element.append(this.#context.canvas);
    element.hidden = true;
    onResize(this.#context.canvas, () => this.#draw());
  }

  /** Shows or hides the traces, and the belief beside them. */
  show(on, belief) {
    this.#on = on || belief;
    this.#beliefOn = belief;
    this.#context.canvas.parentElement.hidden = !this.#on;
    this.#draw();
  }

  /** Keeps what came with a frame that was exposed at `time` (milliseconds). While a session is under way nothing does. */
  add({ asked, measured, metric, belief }, time) {
    if (asked === null) {
      this.#points = [];
      return this.#draw();
    }
    this.#points.push({ time, asked, measured, metric });
    this.#belief = belief;
    const past = this.#points.findIndex((point) => point.time > time - SECONDS * 1000);
    this.#points.splice(0, past);
    this.#draw();
  }

  #draw() {
    const context = this.#context;
    const { width, height } = context.canvas;
    context.clearRect(0, 0, width, height);
    const last = this.#points.at(-1);
    if (!this.#on || !last) return;
    const dpr = pixelsPerCss(context.canvas);
    const line = 1.5 * dpr;
    const top = 20 * dpr;
    const right = width * (1 - BELIEF_SHARE);
    const x = ({ time }) => right * (1 - (last.time - time) / (SECONDS * 1000));
    const y = (share) => height - line - (height - top - 2 * line) * share;
    const greatest = this.#points.reduce((most, { metric }) => Math.max(most, metric ?? 0), 1e-9);
    this.#trace(METRIC, line, x, ({ metric }) => (metric == null ? null : y(metric / greatest)));
    this.#trace(MEASURED, line, x, ({ measured }) => (measured == null ? null : y(measured)));
    this.#trace(ASKED, line, x, ({ asked }) => y(asked));
    this.#legend(last, dpr);
    if (this.#beliefOn && this.#belief) this.#bars(this.#belief, right, y, dpr);
  }

  #trace({ colour }, line, x, y) {
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

  #legend(last, dpr) {
    const context = this.#context;
    Object.assign(context, { font: `${12 * dpr}px system-ui, sans-serif`, textBaseline: "top" });
    [ASKED, MEASURED, METRIC].forEach(({ colour, label }, index) => {
      const value = last[label];
      context.fillStyle = colour;
      context.fillText(`${label} ${value == null ? "–" : value.toPrecision(3)}`, (8 + 120 * index) * dpr, 4 * dpr);
    });
  }

  #bars(belief, left, y, dpr) {
    const context = this.#context;
    const longest = context.canvas.width - left;
    const greatest = Math.max(...belief, 1e-9);
    context.fillStyle = BELIEF_COLOUR;
    belief.forEach((probability, slice) => {
      const [from, to] = [y((slice + 1) / belief.length), y(slice / belief.length)];
      context.fillRect(left, from, (probability / greatest) * longest, Math.max(to - from - dpr / 2, dpr / 2));
    });
  }
}
