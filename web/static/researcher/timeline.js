// The timeline's arithmetic: where a moment and a focal power are in the drawing, and the paths through them.

/** @typedef {Api.Timeline} Timeline */
/** @typedef {Api.TimelinePoint} Point */

/** The drawing's height, and the space for text around its plot, in pixels. */
export const HEIGHT = 260;
const EDGE = { left: 44, right: 12, top: 42, bottom: 26 };

/** Comments are drawn at this focal power if the focal path is not drawn. */
const MIDDLE = 0.5;

/** Steps between the times below the drawing, in seconds. */
const TICK_STEPS = [5, 10, 15, 30, 60, 120, 300, 600];
const QUARTER = 900;

/** A time below the drawing needs this many pixels. */
const TICK_WIDTH = 90;

/**
 * Seconds from the start to the last thing that happened or was recorded, at least 1.
 *
 * @param {Timeline} timeline
 * @param {{ from: number, to: number }[]} [recorded]
 */
export function lengthOf(
  { settings, pauses, absences, points, comments, set_aside: setAside },
  recorded = [],
) {
  const spans = [...settings, ...pauses, ...absences, ...recorded].map(({ from, to }) => to ?? from);
  const moments = [...points.slice(-1), ...comments, ...setAside].map(({ seconds }) => seconds);
  return Math.max(1, ...spans, ...moments);
}

/** Converts seconds and focal power into pixels of a drawing that is `width` pixels wide. */
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

  /**
   * The seconds at a pixel, clamped to the timeline.
   *
   * @param {number} x
   */
  secondsAt(x) {
    const share = (x - this.left) / (this.right - this.left);
    return Math.min(Math.max(share, 0), 1) * this.total;
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
   * The box of a span of time, at least `narrowest` pixels wide. A span without an end lasts to the timeline's end.
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
    const shortest = (this.total * TICK_WIDTH) / this.width;
    // A session that was left open overnight has its times quarters of an hour apart, or several of them.
    const step = TICK_STEPS.find((seconds) => seconds >= shortest) ?? Math.ceil(shortest / QUARTER) * QUARTER;
    return Array.from({ length: Math.floor(this.total / step) + 1 }, (_, index) => index * step);
  }
}

/**
 * The focal power of the lens: as measured, or as asked for if it was not measured.
 *
 * @param {Point} point
 */
export function powerOf(point) {
  return point.measured ?? point.asked;
}

/**
 * The focal power at about `seconds`; the middle if there are no points.
 *
 * @param {Point[]} points
 * @param {number} seconds
 */
export function powerAt(points, seconds) {
  const nearest = nearestPoint(points, seconds);
  return nearest ? powerOf(nearest) : MIDDLE;
}

/**
 * The point nearest to `seconds`; null if there are no points.
 *
 * @param {Point[]} points
 * @param {number} seconds
 */
export function nearestPoint(points, seconds) {
  const distance = (/** @type {Point} */ point) => Math.abs(point.seconds - seconds);
  /** @type {Point | null} */
  let nearest = null;
  for (const point of points) {
    if (nearest === null || distance(point) < distance(nearest)) nearest = point;
  }
  return nearest;
}

/**
 * The first of `spans` that includes `seconds`. A span without an end goes on.
 *
 * @template {{ from: number, to?: number | null }} Span
 * @param {Span[]} spans
 * @param {number} seconds
 */
export function spanAt(spans, seconds) {
  return spans.find(({ from, to }) => from <= seconds && (to == null || seconds <= to));
}

/**
 * The number of the setting under way at `seconds`, counted from 1; null between settings.
 *
 * @param {Timeline["settings"]} settings
 * @param {number} seconds
 */
export function settingAt(settings, seconds) {
  return spanAt(settings, seconds)?.setting ?? null;
}

/**
 * The index of the last comment made by `seconds`; -1 before the first.
 *
 * @param {{ seconds: number }[]} comments in any order
 * @param {number} seconds
 */
export function lastComment(comments, seconds) {
  let last = -1;
  for (const [index, comment] of comments.entries()) {
    const later = last < 0 || comment.seconds >= (comments[last]?.seconds ?? 0);
    if (comment.seconds <= seconds && later) last = index;
  }
  return last;
}

/**
 * A line through `value` of each point, as the `d` of an SVG path. It is broken between settings, where there is no
 * value, and where the count of frames started again.
 *
 * @param {Point[]} points
 * @param {(point: Point) => number | null | undefined} value
 * @param {Scale} scale
 */
export function linePath(points, value, scale) {
  return brokenLine(points, value, scale, (power) => scale.y(power));
}

/**
 * The line of the metric between `top` and `bottom`, as the `d` of an SVG path. The largest metric of each setting is
 * at the top, 0 at the bottom.
 *
 * @param {Point[]} points
 * @param {Scale} scale
 * @param {number} top
 * @param {number} bottom
 */
export function metricPath(points, scale, top, bottom) {
  /** @type {Map<number, number>} */
  const greatest = new Map();
  for (const { setting, metric } of points) {
    greatest.set(setting, Math.max(greatest.get(setting) ?? 0, metric ?? 0));
  }

  const share = (/** @type {Point} */ { setting, metric }) =>
    metric == null ? null : metric / (greatest.get(setting) || 1);
  return brokenLine(points, share, scale, (part) => bottom - part * (bottom - top));
}

/**
 * @param {Point[]} points
 * @param {(point: Point) => number | null | undefined} value
 * @param {Scale} scale
 * @param {(value: number) => number} y
 */
function brokenLine(points, value, scale, y) {
  /** @type {Point | null} */
  let before = null;
  let path = "";

  for (const point of points) {
    const found = value(point);
    if (found == null) {
      before = null;
      continue;
    }
    const goesOn = before !== null && before.setting === point.setting && before.frame < point.frame;
    path += `${goesOn ? "L" : "M"}${scale.x(point.seconds).toFixed(1)} ${y(found).toFixed(1)}`;
    before = point;
  }
  return path;
}
