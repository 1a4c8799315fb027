// What fingers and a mouse do on the picture: drag, pinch, double tap.

/** @typedef {import("./framing.js").Point} Point */

/** CSS pixels that a finger may move, or two taps lie apart: gloves are not precise. */
const SLOP = 12;
const NEAR = 40;

/** The longest tap, and the longest time from one to the next, milliseconds. */
const TAP_MS = 350;
const DOUBLE_MS = 400;

/**
 * What gestures move.
 *
 * @typedef {object} Movable
 * @property {(factor: number, point: Point) => void} zoomBy
 * @property {(dx: number, dy: number) => void} moveBy
 * @property {(point: Point) => void} toggle
 */

/** Makes pointers into movements. Points in CSS pixels, times in milliseconds. */
export class Gestures {
  #target;
  /** Where each pointer is, in the order in which they came. @type {Map<number, Point>} */
  #pointers = new Map();
  /** A touch that may become a tap. @type {(Point & { at: number }) | null} */
  #press = null;
  /** The last tap. @type {(Point & { at: number }) | null} */
  #tap = null;

  /** @param {Movable} target */
  constructor(target) {
    this.#target = target;
  }

  /**
   * @param {number} id
   * @param {Point} point
   * @param {number} now
   */
  down(id, point, now) {
    this.#pointers.set(id, point);
    // The second finger of a pinch is no tap, and neither was the first.
    this.#press = this.#pointers.size === 1 ? { ...point, at: now } : null;
    if (this.#pointers.size > 1) this.#tap = null;
  }

  /**
   * @param {number} id
   * @param {Point} point
   */
  move(id, point) {
    const before = this.#pointers.get(id);
    if (!before) return;
    if (this.#press && distance(this.#press, point) <= SLOP) return;

    this.#press = null;
    const pair = this.#pair();
    this.#pointers.set(id, point);

    if (!pair) this.#target.moveBy(point.x - before.x, point.y - before.y);
    else this.#pinch(pair, this.#pair() ?? pair);
  }

  /**
   * @param {number} id
   * @param {Point} point
   * @param {number} now
   */
  up(id, point, now) {
    if (!this.#pointers.delete(id)) return;

    const press = this.#press;
    this.#press = null;
    if (!press || now - press.at > TAP_MS) return;

    const isSecond = this.#tap && now - this.#tap.at <= DOUBLE_MS && distance(this.#tap, point) <= NEAR;
    this.#tap = isSecond ? null : { ...point, at: now };
    if (isSecond) this.#target.toggle(point);
  }

  /**
   * The browser has taken the pointer for something else.
   *
   * @param {number} id
   */
  cancel(id) {
    this.#pointers.delete(id);
    this.#press = null;
  }

  /** The two pointers that pinch. @returns {[Point, Point] | null} */
  #pair() {
    const [a, b] = this.#pointers.values();
    return a && b ? [a, b] : null;
  }

  /**
   * @param {[Point, Point]} before
   * @param {[Point, Point]} after
   */
  #pinch(before, after) {
    const from = middle(before);
    const to = middle(after);
    const apart = Math.max(1, distance(...before));
    this.#target.zoomBy(distance(...after) / apart, from);
    this.#target.moveBy(to.x - from.x, to.y - from.y);
  }
}

/** @param {[Point, Point]} points */
function middle([a, b]) {
  return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 };
}

/**
 * @param {Point} a
 * @param {Point} b
 */
function distance(a, b) {
  return Math.hypot(a.x - b.x, a.y - b.y);
}
