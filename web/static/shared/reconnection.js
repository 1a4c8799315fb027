// When a lost connection is tried again, and when a silent one counts as lost.

const FIRST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 5000;

/**
 * The server says something at least every 5 s. After this long without a word the connection is
 * dead.
 */
const SILENCE_MS = 12000;

export class Reconnection {
  #wait = FIRST_WAIT_MS;
  #heardAt = 0;

  /**
   * The server was heard, or a connection to it was begun.
   *
   * @param {number} now milliseconds
   */
  heard(now) {
    this.#heardAt = now;
  }

  /** The connection stands. */
  opened() {
    this.#wait = FIRST_WAIT_MS;
  }

  /** @param {number} now */
  isSilent(now) {
    return now - this.#heardAt > SILENCE_MS;
  }

  /**
   * Milliseconds to wait before the next attempt: twice as long after each, up to a limit.
   * Randomness keeps the pages of a restarted server from all coming at one moment.
   *
   * @param {number} random from 0 to 1
   */
  nextWait(random) {
    const wait = this.#wait * (0.75 + random / 2);
    this.#wait = Math.min(this.#wait * 2, LONGEST_WAIT_MS);
    return wait;
  }
}
