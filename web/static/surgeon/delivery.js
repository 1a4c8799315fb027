// Sends what waits on this device, one entry after another, and tries again later while something is left.

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 8000;

/**
 * @template {{ id: string }} Entry
 * @typedef {object} Queue
 * @property {() => Entry[]} waiting what is to be sent, in order
 * @property {(entry: Entry) => Promise<boolean>} send sends one entry, and returns whether the next is worth trying
 * @property {(run: () => void, ms: number) => () => void} later returns a function that cancels the call
 */

/** @template {{ id: string }} Entry */
export class Delivery {
  #queue;
  #isSending = false;
  #wait = FIRST_WAIT_MS;
  #cancel = () => {};

  /** @param {Queue<Entry>} queue */
  constructor(queue) {
    this.#queue = queue;
  }

  /** Whether an attempt is under way, which also sends what is added now. */
  get isSending() {
    return this.#isSending;
  }

  /** Tries to send now, without waiting any longer. */
  nudge() {
    this.#cancel();
    this.hurry();
    this.#attempt();
  }

  /** After the next failure it waits only as long as after a first one. */
  hurry() {
    this.#wait = FIRST_WAIT_MS;
  }

  async #attempt() {
    if (this.#isSending) return;
    this.#isSending = true;

    const { waiting, send, later } = this.#queue;
    const tried = new Set();
    const next = () => waiting().find(({ id }) => !tried.has(id));
    for (let entry = next(); entry; entry = next()) {
      tried.add(entry.id);
      if (!(await send(entry))) break;
    }

    this.#isSending = false;
    if (waiting().length > 0) {
      this.#cancel = later(() => this.#attempt(), this.#wait);
      this.#wait = Math.min(this.#wait * 2, LONGEST_WAIT_MS);
    }
  }
}
