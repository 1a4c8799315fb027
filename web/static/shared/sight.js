// What is seen on a page: the size of its pictures, how many there are, and whether the link makes them smaller.

/** The rate is that of the last seconds. */
const RATE_MS = 2000;

/** A link begins with small pictures. They are reported as reduced only after this time. */
const REDUCED_MS = 3000;

export class Sight {
  /** When the latest pictures were shown, the oldest first. @type {number[]} */
  #shown = [];
  /** @type {number | null} */
  #width = null;
  /** Since when the pictures are smaller than the screen can show. @type {number | null} */
  #reducedSince = null;

  /**
   * Notes that a picture is shown at `now`.
   *
   * @param {{ width: number, reduced: boolean }} header
   * @param {number} now milliseconds
   */
  see({ width, reduced }, now) {
    this.#width = width;
    this.#shown.push(now);
    this.#forget(now);
    this.#reducedSince = reduced ? (this.#reducedSince ?? now) : null;
  }

  /**
   * Whether the pictures have been smaller for some time than the screen can show, because the link is slow.
   *
   * @param {number} now
   */
  isReduced(now) {
    return this.#reducedSince !== null && now - this.#reducedSince >= REDUCED_MS;
  }

  /**
   * What is seen at `now`, for a comment; both are null before the first picture.
   *
   * @param {number} now
   */
  at(now) {
    this.#forget(now);
    const rate = this.#shown.length / (RATE_MS / 1000);
    return { picture_width: this.#width, pictures_per_second: this.#width === null ? null : rate };
  }

  /** @param {number} now */
  #forget(now) {
    const kept = this.#shown.findIndex((shown) => now - shown < RATE_MS);
    this.#shown.splice(0, kept < 0 ? this.#shown.length : kept);
  }
}
