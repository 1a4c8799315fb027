// The pictures of a recording as they come from the server: a few at a time, ahead of playback, and forgotten when
// they are far behind.

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

  /** Those that are there, the one that came last at the end. @type {Map<number, Arrived<Picture>>} */
  #there = new Map();
  /** @type {Map<number, AbortController>} */
  #coming = new Map();
  /** Those that are needed, the most urgent first. @type {number[]} */
  #wanted = [];

  /**
   * @param {object} options
   * @param {(frame: number, signal: AbortSignal) => Promise<Picture>} options.load
   * @param {(error: unknown) => string | null} options.explain why the server has no such picture, in words; null where
   *   it did not answer
   * @param {(frame: number) => void} options.arrived
   * @param {(error: unknown) => void} options.failed the server did not answer
   * @param {number} [options.atOnce] pictures asked for at the same time
   * @param {number} [options.kept] pictures that are kept
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
   * Asks for the pictures of `frames`, the most urgent first, and no longer for others.
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

  /** Forgets all pictures: they are wanted in another size. */
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

    // Asked for no longer.
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
 * Gives back a bitmap's memory.
 *
 * @param {any} picture
 */
function close(picture) {
  picture?.close?.();
}
