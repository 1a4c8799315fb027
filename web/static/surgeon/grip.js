// Tracks what holds the talk button down: a finger, the mouse or a key. Only one of them can talk at a time.

export class Grip {
  #talk;
  /** What was pressed last and is not released yet. @type {string | null} */
  #by = null;

  /** @param {Pick<import("./talk.js").Talk, "press" | "release" | "state">} talk */
  constructor(talk) {
    this.#talk = talk;
  }

  /**
   * `by` is pressed. A pedal may stay down after its recording has ended, for example because something lies on it. It
   * then does not keep a finger from talking, and it talks again only after it was released.
   *
   * @param {string} by
   */
  press(by) {
    if (this.#by === by || this.#talk.state !== "idle") return;
    if (this.#talk.press()) this.#by = by;
  }

  /**
   * `by` is released. Returns whether it was what held the button.
   *
   * @param {string} by
   */
  release(by) {
    if (this.#by !== by) return false;
    this.#by = null;
    this.#talk.release();
    return true;
  }

  /** Call this when the page can no longer notice whether the button is held. */
  leave() {
    if (this.#by === null) return;
    this.#by = null;
    this.#talk.release("left");
  }
}
