// Decides whether a tap is meant for something that has just appeared under the finger. A tap that began before it
// appeared, or right after, was meant for what was there before; so was the second half of a double tap.

/** A tap this soon after something appeared was meant for what was there before. */
export const NOT_MEANT_MS = 600;

export class TapGuard {
  #shownAt = Number.NEGATIVE_INFINITY;
  /** Whether the finger that is down, or was down last, came too soon. */
  #tooSoon = false;

  /**
   * Call this when something appears.
   *
   * @param {number} now milliseconds
   */
  shown(now) {
    this.#shownAt = now;
  }

  /**
   * A finger touches. Returns whether it is meant.
   *
   * @param {number} now
   */
  touch(now) {
    this.#tooSoon = this.#isTooSoon(now);
    return !this.#tooSoon;
  }

  /**
   * A click. Returns whether it is meant.
   *
   * @param {number} now
   * @param {boolean} byKey
   */
  click(now, byKey) {
    return !this.#isTooSoon(now) && (byKey || !this.#tooSoon);
  }

  /** @param {number} now */
  #isTooSoon(now) {
    return now - this.#shownAt < NOT_MEANT_MS;
  }
}
