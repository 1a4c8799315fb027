// Pointing at what is to be in focus: a tap on the picture, a key or a button. It says where a ring is drawn, and sends
// the place once the tap cannot become a double tap any more. Nothing here depends on what the focus does.

import { cellsOf } from "./fit.js";

/** @typedef {{ x: number, y: number }} Cell a place in the picture, in mosaic cells from its upper left corner */

/** A second tap this soon after the first one zooms. Only then is it known that the first one points. */
const SECOND_TAP_MS = 250;

/** A tap this soon after one that removed something from over the picture is that one's other half. */
export const OTHER_HALF_MS = 500;

/** How long the ring stands. */
const RING_MS = 1200;

/** A key moves the place by this fraction of the picture's height. */
const NUDGE = 1 / 24;

/**
 * @typedef {object} Parts
 * @property {(frame: number, at: Cell | null) => Promise<unknown>} send tells the server; null stands for the centre
 * @property {(run: () => void, ms: number) => () => void} later runs `run` after a while, unless the result is called
 * @property {() => number} now milliseconds
 * @property {() => void} changed the ring is drawn anew
 * @property {(trouble: unknown) => void} report called with what went wrong; null after something went well
 * @property {() => string} whyNot why the picture cannot be pointed at now; empty if it can
 */

export class Pointing {
  #parts;
  /** Whether people may point now. */
  allowed = false;
  /** @type {(Cell & { until: number }) | null} */
  #ring = null;
  /** A place that is sent soon. @type {{ at: Cell, frame: number } | null} */
  #waiting = null;
  #forgetWaiting = () => {};
  /** Taps before this moment are not meant for the picture. */
  #coveredUntil = Number.NEGATIVE_INFINITY;
  /** What came with the latest picture. @type {Stream.Header | null} */
  #header = null;

  /** @param {Parts} parts */
  constructor(parts) {
    this.#parts = parts;
  }

  /** Where the ring is now; null if there is none. */
  get ring() {
    return this.#ring && this.#parts.now() < this.#ring.until ? this.#ring : null;
  }

  /** Whether the patch was pointed somewhere, so that its corners stay on the picture. */
  get isPointed() {
    return this.#header?.pointed ?? false;
  }

  /**
   * A picture is shown. If somebody has pointed, here or at another tablet, the ring shows where.
   *
   * @param {Stream.Header} header
   */
  see(header) {
    const before = this.#header;
    this.#header = header;
    if (before && header.choices > before.choices && !this.#waiting) this.#draw(middleOf(header.patch));
  }

  /** A tap removes something that lay over the picture. The other half of a double tap is not meant for the picture. */
  uncover() {
    this.#coveredUntil = this.#parts.now() + OTHER_HALF_MS;
  }

  /**
   * The picture was tapped at `cell`.
   *
   * @param {Cell} cell
   */
  tap(cell) {
    if (this.#parts.now() < this.#coveredUntil || !this.#isOpen()) return;
    if (!isInside(cell, this.#header)) return;
    this.#wait(cell);
  }

  /** The tap was the first of a double tap, which zooms. */
  takeBack() {
    if (!this.#waiting) return;
    this.#waiting = null;
    this.#forgetWaiting();
    this.#clear();
  }

  /**
   * A key moves the place by a step.
   *
   * @param {number} across -1, 0 or 1
   * @param {number} down
   */
  nudge(across, down) {
    if (!this.#isOpen() || !this.#header) return;
    const from = this.#waiting?.at ?? middleOf(this.#header.patch);
    const step = NUDGE * cellsOf(this.#header).height;
    const cell = { x: from.x + across * step, y: from.y + down * step };
    if (isInside(cell, this.#header)) this.#wait(cell);
  }

  /** Points at the centre. */
  centre() {
    if (!this.#isOpen() || !this.#header) return;
    this.takeBack();
    this.#send(this.#header.frame, null);
  }

  #isOpen() {
    if (!this.allowed) return false;
    const why = this.#parts.whyNot();
    if (why !== "") this.#parts.report(why);
    return why === "";
  }

  /** @param {Cell} at */
  #wait(at) {
    this.#waiting = { at, frame: this.#header?.frame ?? 0 };
    this.#draw(at);
    this.#forgetWaiting();
    this.#forgetWaiting = this.#parts.later(() => {
      const waiting = this.#waiting;
      this.#waiting = null;
      if (waiting) this.#send(waiting.frame, waiting.at);
    }, SECOND_TAP_MS);
  }

  /**
   * @param {number} frame
   * @param {Cell | null} at
   */
  async #send(frame, at) {
    try {
      await this.#parts.send(frame, at);
      this.#parts.report(null);
    } catch (error) {
      this.#clear();
      this.#parts.report(error);
    }
  }

  /** @param {Cell} cell */
  #draw({ x, y }) {
    this.#ring = { x, y, until: this.#parts.now() + RING_MS };
    this.#parts.changed();
    this.#parts.later(() => this.#parts.changed(), RING_MS + 20);
  }

  #clear() {
    this.#ring = null;
    this.#parts.changed();
  }
}

/** @param {Stream.Patch} patch */
function middleOf({ x, y, width, height }) {
  return { x: x + width / 2, y: y + height / 2 };
}

/**
 * @param {Cell} cell
 * @param {Stream.Header | null} header
 */
function isInside({ x, y }, header) {
  if (!header) return false;
  const { width, height } = cellsOf(header);
  return x >= 0 && y >= 0 && x <= width && y <= height;
}
