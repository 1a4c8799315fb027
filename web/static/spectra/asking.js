// Asks for something again and again, one request at a time. Without the DOM.

/**
 * @typedef {object} Time
 * @property {(run: () => void, ms: number) => () => void} later runs `run` after a while, unless the result is called
 * @property {() => number} now milliseconds
 */

/** The browser's own time. @type {Time} */
const TIME = {
  later: (run, ms) => {
    const timer = setTimeout(run, ms);
    return () => clearTimeout(timer);
  },
  now: () => performance.now(),
};

export class Asking {
  #what;
  #time;
  #asking = false;
  /** When to ask next; null if there is nothing to ask. @type {number | null} */
  #due = null;
  #forget = () => {};

  /**
   * @param {() => Promise<void>} what asks, and deals with the answer; never rejects
   * @param {Time} [time]
   */
  constructor(what, time = TIME) {
    this.#what = what;
    this.#time = time;
  }

  /**
   * Asks `ms` from now, or earlier if that was wanted before. While a request is under way, after it.
   *
   * @param {number} [ms]
   */
  want(ms = 0) {
    const due = this.#time.now() + ms;
    if (this.#due !== null && this.#due <= due) return;
    this.#due = due;
    if (!this.#asking) this.#wait();
  }

  /** Asks no more until it is wanted again. */
  stop() {
    this.#due = null;
    this.#forget();
  }

  #wait() {
    this.#forget();
    if (this.#due === null) return;
    const ms = this.#due - this.#time.now();
    if (ms <= 0) this.#ask();
    else this.#forget = this.#time.later(() => this.#ask(), ms);
  }

  async #ask() {
    this.#due = null;
    this.#asking = true;
    await this.#what();
    this.#asking = false;
    this.#wait();
  }
}
