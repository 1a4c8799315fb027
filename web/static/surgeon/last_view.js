// The session as the server last told it, kept on this device, so that the page knows where it
// stands when it is loaded again without a network. It is the surgeon's view, which holds nothing of
// a policy. It belongs to the link by which the tablet was let in, and goes when the session ends.

import { isEnded } from "./words.js";

const NAME = "parfocal.last-view";

/** After this long the tablet may be in other hands, and the session on the server elsewhere. */
const KEPT_MS = 2 * 60 * 60 * 1000;

/** @typedef {Api.SurgeonView} View */

/**
 * What is known of the server while it is not heard.
 *
 * @typedef {object} Heard
 * @property {number} heardAt when it was last heard, in milliseconds since 1970
 * @property {number | null} certificateEnd when its certificate ends, likewise; null where it has none, or did not say
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
   * The server told this view.
   *
   * @param {View | null} view
   */
  keep(view) {
    if (view === null || isEnded(view)) {
      this.forget();
      return;
    }
    // Time goes on while nobody is heard: what is left then is not known, nor whether a prompt is due.
    const lasting = { ...view, remaining_seconds: null, prompt: null };
    const certificateEnd = this.#parse()?.certificateEnd ?? null;
    this.#write({ link: this.#link, heardAt: this.#wall(), certificateEnd, view: lasting });
  }

  /** The server told nothing new of the session, and this is what else is known of it. @param {Heard} heard */
  touch(heard) {
    const kept = this.read();
    if (kept) this.#write({ ...kept, ...heard });
  }

  /**
   * What is kept and may still be shown.
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
    // A device that keeps nothing opens the page without it.
    this.#store.write(NAME, JSON.stringify(kept));
  }
}
