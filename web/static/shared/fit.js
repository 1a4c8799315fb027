// The part of the picture that the view is fitted to: the bright circle, not the dark sides of the
// sensor. It does not change while the circle trembles or is lost for a while, whatever the focus does.

/** @typedef {{ width: number, height: number }} Extent */
/** @typedef {{ x: number, y: number, width: number, height: number }} Region */

/** Width of the margin shown around the circle, as a fraction of its radius. */
const MARGIN = 0.03;

/** The view is fitted again only if the circle has moved or grown by more than this fraction of its radius. */
const MOVED = 0.08;
/** Later pictures must agree on the new circle to within this fraction of its radius ... */
const AGREED = 0.04;
/** ... for this long. */
const LASTING_MS = 1000;

/** The view then glides to the new fit. After this long it has covered 63 % of the way. */
const GLIDE_MS = 150;
/** A glide ends when it is off by less than this, in mosaic cells. */
const THERE = 0.25;

/**
 * A picture's extent in mosaic cells, the unit of all places on the picture.
 *
 * @param {Pick<Stream.Header, "width" | "height" | "per_cell">} header
 * @returns {Extent}
 */
export function cellsOf({ width, height, per_cell: perCell }) {
  return { width: width / perCell, height: height / perCell };
}

/** Follows the bright circle. Lengths are in mosaic cells, from the picture's upper left corner. */
export class Fit {
  #glides;
  /** @type {Extent | null} */
  #cells = null;
  /** @type {Stream.Circle | null} */
  #circle = null;
  /** A circle at another place, and since when it is seen. @type {{ circle: Stream.Circle, since: number } | null} */
  #doubted = null;
  /** @type {Region} */
  #target = { x: 0, y: 0, width: 1, height: 1 };
  #region = this.#target;
  #seenAt = 0;

  /** @param {{ glides: boolean }} options whether the view glides to a new fit; otherwise it jumps */
  constructor({ glides }) {
    this.#glides = glides;
  }

  /**
   * Updates the fit from a picture of size `cells`, shown at `now` (milliseconds). `circle` is null if none is seen.
   * Returns the part to show.
   *
   * @param {Extent} cells
   * @param {Stream.Circle | null} circle
   * @param {number} now
   * @returns {Region}
   */
  see(cells, circle, now) {
    if (this.#cells?.width !== cells.width || this.#cells.height !== cells.height) {
      this.#cells = cells;
      this.#doubted = null;
      this.#fitTo(circle);
      this.#region = this.#target;
    } else if (circle && this.#hasMovedTo(circle, now)) {
      this.#fitTo(circle);
    }

    this.#glide(now - this.#seenAt);
    this.#seenAt = now;
    return this.#region;
  }

  /**
   * Whether the circle has stayed at a new place for long enough to fit the view again.
   *
   * @param {Stream.Circle} circle
   * @param {number} now
   */
  #hasMovedTo(circle, now) {
    if (this.#circle && distance(this.#circle, circle) <= MOVED * this.#circle.radius) {
      this.#doubted = null;
      return false;
    }

    const agreed = this.#doubted && distance(this.#doubted.circle, circle) <= AGREED * circle.radius;
    if (!this.#doubted || !agreed) this.#doubted = { circle, since: now };
    return now - this.#doubted.since >= LASTING_MS;
  }

  /** @param {Stream.Circle | null} circle */
  #fitTo(circle) {
    this.#circle = circle;
    this.#doubted = null;
    if (this.#cells) this.#target = around(circle, this.#cells);
  }

  /** @param {number} ms since the last picture */
  #glide(ms) {
    const left = this.#glides ? Math.exp(-ms / GLIDE_MS) : 0;
    const toward = (/** @type {number} */ from, /** @type {number} */ to) => to + (from - to) * left;
    const [from, to] = [this.#region, this.#target];
    const region = {
      x: toward(from.x, to.x),
      y: toward(from.y, to.y),
      width: toward(from.width, to.width),
      height: toward(from.height, to.height),
    };

    const off = Math.abs(region.x - to.x) + Math.abs(region.y - to.y) + Math.abs(region.width - to.width);
    this.#region = off < THERE ? to : region;
  }
}

/**
 * The part of a picture that holds `circle`; the whole picture if there is no circle.
 *
 * @param {Stream.Circle | null} circle
 * @param {Extent} cells
 * @returns {Region}
 */
function around(circle, cells) {
  const whole = { x: 0, y: 0, ...cells };
  if (!circle) return whole;

  const reach = circle.radius * (1 + MARGIN);
  const x = Math.max(0, circle.x - reach);
  const y = Math.max(0, circle.y - reach);
  const width = Math.min(cells.width, circle.x + reach) - x;
  const height = Math.min(cells.height, circle.y + reach) - y;
  return width > 0 && height > 0 ? { x, y, width, height } : whole;
}

/**
 * @param {Stream.Circle} a
 * @param {Stream.Circle} b
 */
function distance(a, b) {
  return Math.max(Math.hypot(a.x - b.x, a.y - b.y), Math.abs(a.radius - b.radius));
}
