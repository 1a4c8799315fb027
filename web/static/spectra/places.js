// The places whose spectra are shown, and the circle around each of them. Without the DOM.

import { LOOKS } from "./looks.js";

/** Samples of the sensor along each side of a mosaic cell. */
export const SAMPLES = 4;

/** The radius at the beginning, in samples. */
const RADIUS = 24;

/** @typedef {{ x: number, y: number }} Point samples of the mosaic from its upper left corner */
/** @typedef {Point & { look: number }} Place `look` is the index of its look; its number is one more */

/** Up to five places. */
export class Places {
  /** The radius of every place's circle, in samples. */
  radius = RADIUS;
  /** @type {Place[]} */
  #all = [];

  /** The places, by their number. */
  get all() {
    return this.#all;
  }

  /**
   * Adds a place, which gets the first look that is free. Null if there is none.
   *
   * @param {Point} point
   */
  add({ x, y }) {
    const look = LOOKS.findIndex((_, index) => this.#all.every((place) => place.look !== index));
    if (look < 0) return null;
    // A tenth of a sample is finer than any finger, and easy to read and to type.
    const place = { look, x: tenth(x), y: tenth(y) };
    this.#all = [...this.#all, place].sort((a, b) => a.look - b.look);
    return place;
  }

  /** @param {Place} place */
  remove(place) {
    this.#all = this.#all.filter((other) => other !== place);
  }

  clear() {
    this.#all = [];
  }
}

/** @param {number} value */
function tenth(value) {
  return Math.floor(value * 10) / 10;
}
