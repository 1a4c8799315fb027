// Whether a tap or a key is meant for the full-screen notice at a change of setting. One that began
// before the notice was there, or the second half of a double tap, is not. Keys of a comment that
// is being typed are not either.

/** A tap this soon after the notice appeared was meant for what was there before. */
const NOT_MEANT_MS = 600;

/** A key this soon after another belongs to what was being typed. */
const TYPING_MS = 600;

/** @typedef {{ key: string, repeat: boolean, ctrlKey: boolean, metaKey: boolean, altKey: boolean }} Key */

export class NoticeGuard {
  #shownAt = 0;
  #keyAt = Number.NEGATIVE_INFINITY;
  #typedAt = Number.NEGATIVE_INFINITY;

  /**
   * The notice appeared.
   *
   * @param {number} now milliseconds
   */
  shown(now) {
    this.#shownAt = now;
  }

  /**
   * What to do with a key pressed while the notice is `open`: let it through, swallow it, or write
   * it into the comment box, where the surgeon was `writing` when the notice appeared.
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
   * Whether a click is meant. Some browsers take a space's release for a click, whatever became of
   * its press.
   *
   * @param {number} now
   * @param {boolean} byKey
   */
  click(now, byKey) {
    if (now - this.#shownAt < NOT_MEANT_MS) return false;
    return !(byKey && now - this.#typedAt < TYPING_MS);
  }
}
