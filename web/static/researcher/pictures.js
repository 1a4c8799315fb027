// Loads the pictures of a recording from the server: a few at a time, ahead of playback. The oldest ones are dropped
// when there are too many.

/**
 * @template Picture
 * @typedef {{ picture: Picture | null, problem: string | null }} Arrived a picture, or why there is none
 */

/**
 * @template Picture
 */
export class Pictures {
  #load;
  #explain;
  #arrived;
  #failed;
  #atOnce;
  #kept;

  /** The pictures that have arrived, by frame, the latest at the end. @type {Map<number, Arrived<Picture>>} */
  #there = new Map();
  /** @type {Map<number, AbortController>} */
  #coming = new Map();
  /** The frames that are needed, the most urgent first. @type {number[]} */
  #wanted = [];

  /**
   * @param {object} options
   * @param {(frame: number, signal: AbortSignal) => Promise<Picture>} options.load
   * @param {(error: unknown) => string | null} options.explain says why the server has no such picture; null if it may
   *   have one when it is asked again
   * @param {(frame: number) => void} options.arrived called when a picture, or the reason why there is none, arrives
   * @param {(error: unknown) => void} options.failed called when there is no picture for now
   * @param {number} [options.atOnce] how many pictures are requested at the same time
   * @param {number} [options.kept] how many pictures are kept
   */
  constructor({ load, explain, arrived, failed, atOnce = 4, kept = 60 }) {
    this.#load = load;
    this.#explain = explain;
    this.#arrived = arrived;
    this.#failed = failed;
    this.#atOnce = atOnce;
    this.#kept = kept;
  }

  /** @param {number} frame */
  get(frame) {
    return this.#there.get(frame);
  }

  /**
   * Requests the pictures of `frames`, the most urgent first, and cancels all other requests.
   *
   * @param {number[]} frames
   */
  want(frames) {
    this.#wanted = frames;
    for (const [frame, coming] of this.#coming) {
      if (!frames.includes(frame)) {
        this.#coming.delete(frame);
        coming.abort();
      }
    }
    this.#ask();
  }

  /** Drops all pictures, because they are now wanted in another size. */
  clear() {
    this.want([]);
    for (const frame of [...this.#there.keys()]) this.#forget(frame);
  }

  #ask() {
    for (const frame of this.#wanted) {
      if (this.#coming.size >= this.#atOnce) return;
      if (!this.#there.has(frame) && !this.#coming.has(frame)) this.#fetch(frame);
    }
  }

  /** @param {number} frame */
  async #fetch(frame) {
    const coming = new AbortController();
    this.#coming.set(frame, coming);
    /** @type {Arrived<Picture> | null} */
    let arrived = null;
    try {
      arrived = { picture: await this.#load(frame, coming.signal), problem: null };
    } catch (error) {
      const problem = this.#explain(error);
      if (problem !== null) arrived = { picture: null, problem };
      else if (!coming.signal.aborted) this.#failed(error);
    }

    // This request was cancelled meanwhile.
    if (this.#coming.get(frame) !== coming) {
      close(arrived?.picture);
      return;
    }
    this.#coming.delete(frame);
    if (!arrived) return;

    this.#there.set(frame, arrived);
    this.#tidy();
    this.#arrived(frame);
    this.#ask();
  }

  #tidy() {
    for (const frame of [...this.#there.keys()]) {
      if (this.#there.size <= this.#kept) return;
      if (!this.#wanted.includes(frame)) this.#forget(frame);
    }
  }

  /** @param {number} frame */
  #forget(frame) {
    close(this.#there.get(frame)?.picture);
    this.#there.delete(frame);
  }
}

/**
 * Releases a bitmap's memory.
 *
 * @param {any} picture
 */
function close(picture) {
  picture?.close?.();
}
