// The timeline's arithmetic: where in the drawing a moment and a focal power lie, and the path
// between them.

/** @typedef {Api.Timeline} Timeline */
/** @typedef {Api.TimelinePoint} Point */

/** The drawing's height, and the room for words around its plot, in pixels. */
export const HEIGHT = 260;
const EDGE = { left: 44, right: 12, top: 42, bottom: 26 };

/** Where the path is not drawn, comments stand in the middle. */
const MIDDLE = 0.5;

/** Steps between the times below the drawing, in seconds. */
const TICK_STEPS = [5, 10, 15, 30, 60, 120, 300, 600];
const LONGEST_TICK_STEP = 900;

/** A time below the drawing needs this much room. */
const TICK_WIDTH = 90;

/**
 * Seconds from the start to the last thing that happened; at least 1.
 *
 * @param {Timeline} timeline
 */
export function lengthOf({ settings, pauses, points, comments, set_aside: setAside }) {
  const spans = [...settings, ...pauses].map(({ from, to }) => to ?? from);
  const moments = [...points.slice(-1), ...comments, ...setAside].map(({ seconds }) => seconds);
  return Math.max(1, ...spans, ...moments);
}

/** Turns seconds and focal power into pixels of a drawing of this width. */
export class Scale {
  total;
  width;

  /**
   * @param {number} total seconds
   * @param {number} width pixels
   */
  constructor(total, width) {
    this.total = total;
    this.width = width;
  }

  /** @param {number} seconds */
  x(seconds) {
    return this.left + (seconds / this.total) * (this.right - this.left);
  }

  /** @param {number} power focal power, from 0 to 1 */
  y(power) {
    return HEIGHT - EDGE.bottom - power * (HEIGHT - EDGE.top - EDGE.bottom);
  }

  /** The plot's left edge. */
  get left() {
    return EDGE.left;
  }

  /** The plot's right edge. */
  get right() {
    return this.width - EDGE.right;
  }

  /**
   * The box of a span of time, at least `narrowest` pixels wide. One without an end goes on to the
   * end.
   *
   * @param {{ from: number, to?: number | null }} span
   * @param {number} narrowest
   */
  box({ from, to }, narrowest) {
    const x = this.x(from);
    const width = Math.max(this.x(to ?? this.total) - x, narrowest);
    return { x, y: this.y(1), width, height: this.y(0) - this.y(1) };
  }

  /** The times to write below the drawing, in seconds. */
  ticks() {
    const step =
      TICK_STEPS.find((seconds) => this.total / seconds <= this.width / TICK_WIDTH) ?? LONGEST_TICK_STEP;
    return Array.from({ length: Math.floor(this.total / step) + 1 }, (_, index) => index * step);
  }
}

/**
 * The focal power that the lens had: as measured, or else as asked for.
 *
 * @param {Point} point
 */
export function powerOf(point) {
  return point.measured ?? point.asked;
}

/**
 * The focal power at about `seconds`; the middle where no path is drawn.
 *
 * @param {Point[]} points
 * @param {number} seconds
 */
export function powerAt(points, seconds) {
  const distance = (/** @type {Point} */ point) => Math.abs(point.seconds - seconds);
  /** @type {Point | null} */
  let nearest = null;
  for (const point of points) {
    if (nearest === null || distance(point) < distance(nearest)) nearest = point;
  }
  return nearest ? powerOf(nearest) : MIDDLE;
}

/**
 * A line through `value` of each point, as the `d` of an SVG path. It is broken between settings,
 * where there is no value, and where frames were counted anew.
 *
 * @param {Point[]} points
 * @param {(point: Point) => number | null | undefined} value
 * @param {Scale} scale
 */
export function linePath(points, value, scale) {
  /** @type {Point | null} */
  let before = null;
  let path = "";

  for (const point of points) {
    const power = value(point);
    if (power == null) {
      before = null;
      continue;
    }
    const goesOn = before !== null && before.setting === point.setting && before.frame < point.frame;
    path += `${goesOn ? "L" : "M"}${scale.x(point.seconds).toFixed(1)} ${scale.y(power).toFixed(1)}`;
    before = point;
  }
  return path;
}
