// Asks for a second press before something that cannot be undone. The second press must be deliberate: neither the
// other half of a double tap nor a press long after the first.

/** A press sooner than this after the first one counts as the same press. */
const SAME_PRESS_MS = 400;

/** A press later than this after the first one counts as a first press again. */
export const FORGOTTEN_MS = 4000;

export class Confirmation {
  /** @type {number | null} */
  #firstAt = null;

  /**
   * Takes a press at `now` (milliseconds). Returns whether it is the first one, the same one again, or the second one.
   *
   * @param {number} now
   * @returns {"first" | "same" | "second"}
   */
  press(now) {
    const since = this.#firstAt === null ? Number.POSITIVE_INFINITY : now - this.#firstAt;
    if (since >= FORGOTTEN_MS) {
      this.#firstAt = now;
      return "first";
    }
    if (since < SAME_PRESS_MS) return "same";
    this.#firstAt = null;
    return "second";
  }

  forget() {
    this.#firstAt = null;
  }
}
