// What holds the button down: a finger, the mouse or a key. One at a time talks.

export class Grip {
  #talk;
  /** What was pressed last and is not let go yet. @type {string | null} */
  #by = null;

  /** @param {Pick<import("./talk.js").Talk, "press" | "release" | "state">} talk */
  constructor(talk) {
    this.#talk = talk;
  }

  /**
   * Something is pressed. A pedal on which something lies stays down when its recording has ended: it
   * does not keep a finger from talking, and talks again only when it was let go.
   *
   * @param {string} by
   */
  press(by) {
    if (this.#by === by || this.#talk.state !== "idle") return;
    if (this.#talk.press()) this.#by = by;
  }

  /**
   * Something is let go: whether it was what held the button.
   *
   * @param {string} by
   */
  release(by) {
    if (this.#by !== by) return false;
    this.#by = null;
    this.#talk.release();
    return true;
  }

  /** The page no longer hears whether something is held. */
  leave() {
    if (this.#by === null) return;
    this.#by = null;
    this.#talk.release("left");
  }
}
