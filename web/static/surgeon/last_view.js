// Keeps the server's last view of the session on this device, so that the page can show it when it is loaded again
// without a network. It is the surgeon's view, which contains nothing about a policy. It belongs to the link by which
// the tablet was let in, and is removed when the session ends.

import { isEnded } from "./words.js";

const NAME = "parfocal.last-view";

/** The view is kept for this long. Later, another person may hold the tablet, and the session may have moved on. */
const KEPT_MS = 2 * 60 * 60 * 1000;

/** @typedef {Api.SurgeonView} View */

/**
 * What is known about the server while it is silent.
 *
 * @typedef {object} Heard
 * @property {number} heardAt when it was last heard, in milliseconds since 1970
 * @property {number | null} certificateEnd when its certificate ends, likewise; null if it has none or is not known
 */

/** @typedef {Heard & { link: string, view: View }} Kept */

export class LastView {
  #store;
  #link;
  #wall;

  /**
   * @param {import("../shared/storage.js").Store} store
   * @param {string} link the name of the link by which this page was opened
   * @param {() => number} wall milliseconds since 1970
   */
  constructor(store, link, wall) {
    this.#store = store;
    this.#link = link;
    this.#wall = wall;
  }

  /**
   * Keeps a view that the server has just sent. Forgets the last one if no session is under way.
   *
   * @param {View | null} view
   */
  keep(view) {
    if (view === null || isEnded(view)) {
      this.forget();
      return;
    }
    // Time passes while the server is silent. So the remaining time is not known then, nor whether a prompt is due.
    const lasting = { ...view, remaining_seconds: null, prompt: null };
    const certificateEnd = this.#parse()?.certificateEnd ?? null;
    this.#write({ link: this.#link, heardAt: this.#wall(), certificateEnd, view: lasting });
  }

  /** Updates what is known about the server. The kept view stays the same. @param {Heard} heard */
  touch(heard) {
    const kept = this.read();
    if (kept) this.#write({ ...kept, ...heard });
  }

  /**
   * The kept view, if it may still be shown.
   *
   * @returns {Kept | null}
   */
  read() {
    const kept = this.#parse();
    if (kept === null) return null;

    const age = this.#wall() - kept.heardAt;
    if (kept.link === this.#link && age < KEPT_MS) return kept;
    this.forget();
    return null;
  }

  /** The session of the kept view, by whatever link it was opened; null if none is kept. */
  get session() {
    return this.#parse()?.view?.session ?? null;
  }

  forget() {
    this.#store.remove(NAME);
  }

  /** @returns {Kept | null} */
  #parse() {
    try {
      return JSON.parse(this.#store.read(NAME) ?? "null");
    } catch {
      return null;
    }
  }

  /** @param {Kept} kept */
  #write(kept) {
    // If the device cannot store this, the page opens without a last view.
    this.#store.write(NAME, JSON.stringify(kept));
  }
}
