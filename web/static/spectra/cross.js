// The cross that arrow keys move over the picture, to set a place without a pointer. Without the DOM.

/** @typedef {{ x: number, y: number }} Cell mosaic cells from the picture's upper left corner */
/** @typedef {{ width: number, height: number }} Extent */

export class Cross {
  /** Where it is; null while it is not shown. @type {Cell | null} */
  at = null;

  /**
   * Moves it by `dx` and `dy` cells, as far as the picture reaches. It begins in the middle.
   *
   * @param {number} dx
   * @param {number} dy
   * @param {Extent} cells the picture's extent
   */
  move(dx, dy, { width, height }) {
    const from = this.at ?? { x: width / 2, y: height / 2 };
    const within = (/** @type {number} */ value, /** @type {number} */ most) =>
      Math.min(Math.max(value, 0), most - 0.1);
    this.at = { x: within(from.x + dx, width), y: within(from.y + dy, height) };
  }

  hide() {
    this.at = null;
  }
}
