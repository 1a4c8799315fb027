// Where the picture is placed in its box: fitted, or zoomed in by a person. Only people change the zoom.

/** @typedef {import("./fit.js").Extent} Extent */
/** @typedef {import("./fit.js").Region} Region */
/** @typedef {{ x: number, y: number }} Point */

/** The largest zoom is this many times the fitted view, or one sensor sample per screen pixel if that is more. */
const LARGEST_ZOOM = 4;
/** Samples along each side of a mosaic cell. */
const SAMPLES = 4;

/** A double tap zooms in by this factor. */
const DOUBLE_TAP = 2.5;

/** A smaller zoom counts as none. */
const HARDLY = 1.01;

/**
 * Lengths on the page are in CSS pixels from the box's upper left corner. Lengths on the picture are in mosaic cells.
 */
export class Framing {
  /** @type {Extent} */
  #box = { width: 1, height: 1 };
  #density = 1;
  /** @type {Extent} */
  #cells = { width: 1, height: 1 };
  /** @type {Region} */
  #region = { x: 0, y: 0, width: 1, height: 1 };
  /**
   * The point of the picture in the box's middle, and CSS pixels per cell, as a person chose them; null for the fitted
   * view. Kept as chosen, even while the box's shape does not allow it.
   *
   * @type {(Point & { scale: number }) | null}
   */
  #chosen = null;

  /**
   * Sets the box's size and the screen's density.
   *
   * @param {Extent} box in CSS pixels
   * @param {number} density screen pixels per CSS pixel
   */
  resize(box, density) {
    this.#box = { width: Math.max(1, box.width), height: Math.max(1, box.height) };
    this.#density = density;
  }

  /**
   * Sets the size of the picture shown, and the part of it to fit.
   *
   * @param {Extent} cells
   * @param {Region} region
   */
  show(cells, region) {
    this.#cells = cells;
    this.#region = region;
  }

  /** Where the picture's upper left corner is, and CSS pixels per cell. */
  get place() {
    const { x, y, scale } = this.#middle;
    return { left: this.#box.width / 2 - x * scale, top: this.#box.height / 2 - y * scale, scale };
  }

  /** How many times larger the picture is than in the fitted view. */
  get zoom() {
    return this.#middle.scale / this.#fitted.scale;
  }

  /** Screen pixels that the whole picture covers from left to right. */
  get screenWidth() {
    return Math.round(this.#cells.width * this.#middle.scale * this.#density);
  }

  /**
   * Zooms by `factor`. The part of the picture under `point` stays there.
   *
   * @param {number} factor
   * @param {Point} [point] the box's middle by default
   */
  zoomBy(factor, point = { x: this.#box.width / 2, y: this.#box.height / 2 }) {
    const { left, top, scale } = this.place;
    const fitted = this.#fitted.scale;
    const next = clamp(scale * factor, fitted, this.#largest);
    if (next < HARDLY * fitted) {
      this.#chosen = null;
      return;
    }

    const under = { x: (point.x - left) / scale, y: (point.y - top) / scale };
    this.#choose({
      x: under.x + (this.#box.width / 2 - point.x) / next,
      y: under.y + (this.#box.height / 2 - point.y) / next,
      scale: next,
    });
  }

  /**
   * Drags the picture, as far as its edges allow. Does nothing in the fitted view.
   *
   * @param {number} dx
   * @param {number} dy
   */
  moveBy(dx, dy) {
    if (!this.#chosen) return;
    const { x, y, scale } = this.#middle;
    this.#choose({ x: x - dx / scale, y: y - dy / scale, scale });
  }

  /**
   * Zooms in on `point`, or back to the fitted view.
   *
   * @param {Point} point
   */
  toggle(point) {
    if (this.zoom > HARDLY) this.reset();
    else this.zoomBy(DOUBLE_TAP, point);
  }

  /** Goes back to the fitted view. */
  reset() {
    this.#chosen = null;
  }

  /** The fitted view. */
  get #fitted() {
    const { x, y, width, height } = this.#region;
    const scale = Math.min(this.#box.width / width, this.#box.height / height);
    return { x: x + width / 2, y: y + height / 2, scale };
  }

  get #largest() {
    return Math.max(LARGEST_ZOOM * this.#fitted.scale, SAMPLES / this.#density);
  }

  /** The point of the picture in the box's middle, and CSS pixels per cell. */
  get #middle() {
    return this.#chosen ? this.#allowed(this.#chosen) : this.#fitted;
  }

  /** @param {Point & { scale: number }} wanted */
  #choose(wanted) {
    this.#chosen = this.#allowed(wanted);
  }

  /**
   * The view nearest to `chosen` that leaves no more of the box empty than the fitted view does.
   *
   * @param {Point & { scale: number }} chosen
   */
  #allowed(chosen) {
    const fitted = this.#fitted;
    const scale = clamp(chosen.scale, fitted.scale, this.#largest);
    const along = (
      /** @type {number} */ middle,
      /** @type {number} */ fit,
      /** @type {number} */ cells,
      /** @type {number} */ box,
    ) => {
      const half = box / 2 / scale;
      return clamp(middle, Math.min(half, fit), Math.max(cells - half, fit));
    };

    return {
      x: along(chosen.x, fitted.x, this.#cells.width, this.#box.width),
      y: along(chosen.y, fitted.y, this.#cells.height, this.#box.height),
      scale,
    };
  }
}

/**
 * @param {number} value
 * @param {number} least
 * @param {number} most
 */
function clamp(value, least, most) {
  return Math.min(most, Math.max(least, value));
}
