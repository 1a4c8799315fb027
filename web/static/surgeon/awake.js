// Keeps the tablet's screen on while a session is under way (Screen Wake Lock API). A browser ends the lock whenever
// the page is hidden, so the page asks for it again when it is shown.

import { say } from "../shared/language.js";
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
   * @param {(() => Promise<Lock>) | null} around.request null if the browser has no such lock
   * @param {() => boolean} around.isVisible whether the page is visible
   * @param {() => void} around.changed called when `advice` has changed
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

  /** Asks for the lock if it is wanted and missing. The page calls this whenever it becomes visible. */
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
    // The session ended while the request was under way.
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

  /** What people have to do to keep the screen on; empty if the page does it. */
  get advice() {
    if (this.#request !== null && !this.#refused) return "";
    return say("screen-advice");
  }
}

/** The function that asks this browser to keep the screen on; null if it has none. */
export function screenLock() {
  // Missing without a secure context, and in older browsers.
  const { wakeLock } = navigator;
  return wakeLock ? () => wakeLock.request("screen") : null;
}
