// Keeps the tablet's screen on while a session is under way (Screen Wake Lock API). A browser takes
// that back whenever the page goes out of sight, so it is asked again when the page comes back.

import { isEnded } from "./words.js";

/** @typedef {{ release: () => Promise<void>, addEventListener: (type: "release", run: () => void) => void }} Lock */

export class Awake {
  #request;
  #isVisible;
  #changed;
  #wanted = false;
  #asking = false;
  #refused = false;
  /** @type {Lock | null} */
  #lock = null;

  /**
   * @param {object} around
   * @param {(() => Promise<Lock>) | null} around.request null where the browser cannot
   * @param {() => boolean} around.isVisible whether the page is in sight
   * @param {() => void} around.changed called when it turns out whether the screen stays on
   */
  constructor({ request, isVisible, changed }) {
    this.#request = request;
    this.#isVisible = isVisible;
    this.#changed = changed;
  }

  /** @param {Api.SurgeonView | null} view */
  follow(view) {
    this.#wanted = view !== null && !isEnded(view);
    if (this.#wanted) this.ask();
    else this.#release();
  }

  /** Asks for what is wanted and not there. The page calls this whenever it comes into sight. */
  async ask() {
    if (!this.#wanted || this.#lock || this.#asking || !this.#request || !this.#isVisible()) return;
    this.#asking = true;
    try {
      this.#take(await this.#request());
      this.#tell(false);
    } catch {
      // The battery is low, or the system saves power.
      this.#tell(true);
    }
    this.#asking = false;
  }

  /** @param {Lock} lock */
  #take(lock) {
    this.#lock = lock;
    lock.addEventListener("release", () => {
      if (this.#lock === lock) this.#lock = null;
    });
    // The session ended while the browser was asked.
    if (!this.#wanted) this.#release();
  }

  /** @param {boolean} refused */
  #tell(refused) {
    if (refused === this.#refused) return;
    this.#refused = refused;
    this.#changed();
  }

  async #release() {
    const lock = this.#lock;
    this.#lock = null;
    await lock?.release().catch(() => {});
  }

  /** What somebody has to do for the screen to stay on; empty where the page sees to it. */
  get advice() {
    if (this.#request !== null && !this.#refused) return "";
    return "This browser does not keep the screen on. Set the tablet so that its screen stays on.";
  }
}

/** How this browser is asked to keep the screen on; null where it cannot be. */
export function screenLock() {
  // Missing without a secure context, and in older browsers.
  const { wakeLock } = navigator;
  return wakeLock ? () => wakeLock.request("screen") : null;
}
