// Gestures of fingers and a mouse on the picture: drag, pinch, double tap.

/** @typedef {import("./framing.js").Point} Point */

/** CSS pixels that a finger may move during a tap, and that two taps may be apart. Gloves are not precise. */
const SLOP = 12;
const NEAR = 40;

/** The longest tap, and the longest time from one tap to the next, in milliseconds. */
const TAP_MS = 350;
const DOUBLE_MS = 400;

/**
 * The picture that gestures move.
 *
 * @typedef {object} Movable
 * @property {(factor: number, point: Point) => void} zoomBy
 * @property {(dx: number, dy: number) => void} moveBy
 * @property {(point: Point) => void} toggle
 */

/**
 * What is done with single taps.
 *
 * @typedef {object} Tappable
 * @property {(point: Point) => void} tap a tap, which may become the first of a double tap
 * @property {() => void} takeBack the last tap has become the first of a double tap, or of a pinch
 */

/** Turns pointer events into movements of the picture. Points are in CSS pixels, times in milliseconds. */
export class Gestures {
  #target;
  #taps;
  /** Where each pointer is, in the order in which they went down. @type {Map<number, Point>} */
  #pointers = new Map();
  /** A touch that may become a tap. @type {(Point & { at: number }) | null} */
  #press = null;
  /** The last tap. @type {(Point & { at: number }) | null} */
  #tap = null;

  /**
   * @param {Movable} target
   * @param {Tappable | null} [taps]
   */
  constructor(target, taps = null) {
    this.#target = target;
    this.#taps = taps;
  }

  /**
   * @param {number} id
   * @param {Point} point
   * @param {number} now
   */
  down(id, point, now) {
    this.#pointers.set(id, point);
    // A second finger makes this a pinch. Neither finger is a tap then.
    this.#press = this.#pointers.size === 1 ? { ...point, at: now } : null;
    if (this.#pointers.size > 1) {
      // A tap of long ago stands, such as one that has set a place.
      if (this.#tap && now - this.#tap.at <= DOUBLE_MS) this.#taps?.takeBack();
      this.#tap = null;
    }
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
    if (isSecond) {
      this.#taps?.takeBack();
      this.#target.toggle(point);
    } else {
      this.#taps?.tap(point);
    }
  }

  /**
   * The browser has taken over the pointer, for example to scroll.
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
