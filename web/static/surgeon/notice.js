// Decides whether a tap or a key is meant for the full-screen notice at a change of setting. A tap that began before
// the notice appeared is not, nor is the second half of a double tap, nor are keys of a comment that is being typed.

import { NOT_MEANT_MS } from "./tap_guard.js";

/** A key this soon after another one belongs to a text that is being typed. */
const TYPING_MS = 600;

/** @typedef {{ key: string, repeat: boolean, ctrlKey: boolean, metaKey: boolean, altKey: boolean }} Key */

export class NoticeGuard {
  #shownAt = 0;
  #keyAt = Number.NEGATIVE_INFINITY;
  #typedAt = Number.NEGATIVE_INFINITY;

  /**
   * Call this when the notice appears.
   *
   * @param {number} now milliseconds
   */
  shown(now) {
    this.#shownAt = now;
  }

  /**
   * What to do with a key: let it through, swallow it, or write it into the comment box. Keys always pass unless the
   * notice is `open`. `writing` says whether the surgeon was writing in the box when the notice appeared.
   *
   * @param {Key} key
   * @param {number} now
   * @param {{ open: boolean, writing: boolean }} page
   * @returns {"pass" | "swallow" | "write"}
   */
  key(key, now, { open, writing }) {
    const sinceKey = now - this.#keyAt;
    const typing = key.repeat || sinceKey < TYPING_MS || now - this.#shownAt < NOT_MEANT_MS;
    this.#keyAt = now;
    if (!open) return "pass";

    const letter = key.key.length === 1 && !key.ctrlKey && !key.metaKey && !key.altKey;
    const meant = key.key === "Enter" ? !typing : !letter || (!typing && !writing);
    if (meant) return "pass";

    this.#typedAt = now;
    return letter && writing ? "write" : "swallow";
  }

  /**
   * Whether a click is meant for the notice. Some browsers turn the release of the space bar into a click, even if its
   * press was swallowed.
   *
   * @param {number} now
   * @param {boolean} byKey
   */
  click(now, byKey) {
    if (now - this.#shownAt < NOT_MEANT_MS) return false;
    return !(byKey && now - this.#typedAt < TYPING_MS);
  }
}
