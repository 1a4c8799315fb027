// The button that holds the focus: while it is pressed, or from a short press until the next one. A finger, the mouse,
// a key or a pedal presses it.

/** A longer press holds only while it lasts. */
const SHORT_MS = 500;

/** Keys that a pedal can send. F24 writes nothing; PageUp is left to fields for text. */
const PEDAL_KEYS = ["F24", "PageUp"];

/**
 * Whether `key` holds the focus.
 *
 * @param {{ key: string, ctrlKey?: boolean, altKey?: boolean, metaKey?: boolean }} pressed
 * @param {boolean} inField whether the focus of the page is in a field for text
 */
export function isHoldKey({ key, ctrlKey, altKey, metaKey }, inField) {
  if (ctrlKey || altKey || metaKey || !PEDAL_KEYS.includes(key)) return false;
  return key === "F24" || !inField;
}

export class Hold {
  #parts;
  /** Whether the focus is held, by the server's word or as asked for last. */
  held = false;
  /** What is pressed, and since when. @type {{ by: string, at: number, began: boolean } | null} */
  #press = null;
  /** Resolves once everything that was asked for is answered. @type {Promise<unknown>} */
  #answered = Promise.resolve();
  /** How many requests are not answered yet. */
  #open = 0;
  /** What the server has said since the first of them; null if nothing. @type {boolean | null} */
  #said = null;

  /** @param {{ ask: (hold: boolean) => Promise<void>, now: () => number }} parts */
  constructor(parts) {
    this.#parts = parts;
  }

  /**
   * Follows the server's word. Before the answer to a request it may be older than the request, and counts only then.
   *
   * @param {boolean} held
   */
  follow(held) {
    if (this.#open > 0) this.#said = held;
    else this.held = held;
  }

  /** @param {string} by what presses it: a pointer or a key */
  press(by) {
    if (this.#press) return;
    this.#press = { by, at: this.#parts.now(), began: !this.held };
    if (!this.held) this.#ask(true);
  }

  /**
   * `by` is released. Returns whether it was what pressed the button.
   *
   * @param {string} by
   */
  release(by) {
    const press = this.#press;
    if (press?.by !== by) return false;
    this.#press = null;
    const isLong = this.#parts.now() - press.at >= SHORT_MS;
    // The second press ends what the first one began; so does the end of a long press.
    if (this.held && (!press.began || isLong)) this.#ask(false);
    return true;
  }

  /** The page can no longer notice whether the button is pressed. */
  leave() {
    if (this.#press) this.release(this.#press.by);
  }

  /** @param {boolean} hold */
  #ask(hold) {
    this.held = hold;
    // One after another: on a poor network a release could overtake its hold, and the focus would stay held.
    this.#open += 1;
    this.#answered = this.#answered.then(() => this.#parts.ask(hold)).then(() => this.#heard());
  }

  /** A request is answered. */
  #heard() {
    this.#open -= 1;
    if (this.#open > 0) return;
    this.held = this.#said ?? this.held;
    this.#said = null;
  }
}
