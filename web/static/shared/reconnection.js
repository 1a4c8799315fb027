// When a lost connection is tried again, and when a silent one counts as lost.

const FIRST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 5000;

/**
 * The server sends something at least every 5 s. After this long without a message the connection counts as dead.
 */
const SILENCE_MS = 12000;

export class Reconnection {
  #wait = FIRST_WAIT_MS;
  #heardAt = 0;

  /**
   * Call this when the server sends something, or when a connection is begun.
   *
   * @param {number} now milliseconds
   */
  heard(now) {
    this.#heardAt = now;
  }

  /** Call this when the connection is open. */
  opened() {
    this.#wait = FIRST_WAIT_MS;
  }

  /** @param {number} now */
  isSilent(now) {
    return now - this.#heardAt > SILENCE_MS;
  }

  /**
   * Milliseconds to wait before the next attempt: twice as long after each attempt, up to a limit. The random part
   * keeps all pages from coming back at the same moment after the server restarts.
   *
   * @param {number} random from 0 to 1
   */
  nextWait(random) {
    const wait = this.#wait * (0.75 + random / 2);
    this.#wait = Math.min(this.#wait * 2, LONGEST_WAIT_MS);
    return wait;
  }
}
