// Drafts: texts that are being written, kept on this device. A draft belongs to the tab in which it is written. Another
// tab may take it over when asked to, and sends it as it is once its place is gone. A draft carries the key under which
// it will be sent, so that it is saved once even if two tabs send it.

const PREFIX = "parfocal.draft.";

/** @typedef {import("./origin.js").Stamp} Stamp */

/**
 * A draft as stored.
 *
 * @typedef {{ key: string, given: Stamp, value: any }} Kept
 */

/**
 * A draft of any tab. `rest` is its name without the start that was searched for, `owner` its tab, and `slot` the name
 * under which it is stored.
 *
 * @typedef {Kept & { rest: string, owner: string, slot: string }} Found
 */

export class Drafts {
  /** The name of this tab. It stays the same after a reload. */
  tab;
  #store;
  #origins;
  #newId;

  /**
   * @param {import("../shared/storage.js").Store} store
   * @param {import("./origin.js").Origins} origins
   * @param {() => string} newId
   * @param {string} tab
   */
  constructor(store, origins, newId, tab) {
    this.#store = store;
    this.#origins = origins;
    this.#newId = newId;
    this.tab = tab;
  }

  /**
   * This tab's draft called `name`.
   *
   * @param {string} name
   */
  open(name) {
    return new Draft(this, name);
  }

  /**
   * The drafts on this device whose names begin with `start`, of all tabs.
   *
   * @param {string} start
   * @returns {Found[]}
   */
  of(start) {
    return this.#store.names(PREFIX + start).flatMap((slot) => {
      const [name = "", owner = ""] = slot.slice(PREFIX.length).split("#");
      const kept = this.#read(slot);
      return kept ? [{ ...kept, rest: name.slice(start.length), owner, slot }] : [];
    });
  }

  /**
   * The draft in `slot`; null if there is none.
   *
   * @param {string} slot
   * @returns {Kept | null}
   */
  #read(slot) {
    try {
      return JSON.parse(this.#store.read(slot) ?? "null");
    } catch {
      return null;
    }
  }

  /** @param {string} name */
  slotOf(name) {
    return `${PREFIX}${name}#${this.tab}`;
  }

  /**
   * Adds a key and the present stamp to a value.
   *
   * @param {any} value
   * @param {string} [key] the key of the draft's earlier text; a new one if there was none
   * @returns {Kept}
   */
  stamped(value, key = this.#newId()) {
    return { key, given: this.#origins.stamp(), value };
  }

  /**
   * Stores a draft. Returns whether the device keeps it.
   *
   * @param {string} slot
   * @param {Kept} kept
   */
  keep(slot, kept) {
    return this.#store.write(slot, JSON.stringify(kept));
  }

  /**
   * Removes a draft of any tab from this device, because it was sent or taken over.
   *
   * @param {{ slot: string }} draft
   */
  forget({ slot }) {
    this.#store.remove(slot);
  }

  /**
   * Whether `name` in the storage belongs to a draft.
   *
   * @param {string} name
   */
  isSlot(name) {
    return name.startsWith(PREFIX);
  }
}

/** A draft of this tab. */
export class Draft {
  #drafts;
  #name;
  #slot;
  /** @type {Kept | null} */
  #kept;
  #stored;

  /**
   * @param {Drafts} drafts
   * @param {string} name
   */
  constructor(drafts, name) {
    this.#drafts = drafts;
    this.#name = name;
    this.#slot = drafts.slotOf(name);
    this.#kept = drafts.of(name).find(({ rest, owner }) => rest === "" && owner === drafts.tab) ?? null;
    this.#stored = this.#kept !== null;
  }

  /** The value of the draft, or null. */
  read() {
    return this.#kept?.value ?? null;
  }

  /**
   * Keeps `value` as the draft. Null removes the draft.
   *
   * @param {any} value
   */
  write(value) {
    if (value === null) {
      this.take();
      return;
    }
    this.#kept = this.#drafts.stamped(value, this.#kept?.key);
    this.#stored = this.#drafts.keep(this.#slot, this.#kept);
  }

  /**
   * Removes the draft, and returns the key and stamp under which to send it. Both are missing if nothing was written.
   *
   * @returns {{ key?: string, given?: Stamp }}
   */
  take() {
    const { key, given } = this.#kept ?? {};
    this.#kept = null;
    this.#drafts.forget({ slot: this.#slot });
    this.#stored = false;
    return { key, given };
  }

  /**
   * Whether this draft is stored in `slot`.
   *
   * @param {string | null} slot
   */
  isIn(slot) {
    return this.#stored && slot === this.#slot;
  }

  /** Whether another tab has taken this draft over. */
  get claimed() {
    const kept = this.#kept;
    return kept !== null && this.elsewhere().some(({ key }) => key === kept.key);
  }

  /** The drafts with the same name in other tabs. */
  elsewhere() {
    return this.#drafts.of(this.#name).filter(({ rest, owner }) => rest === "" && owner !== this.#drafts.tab);
  }

  /**
   * Takes over `other`, one of the drafts of `elsewhere()`.
   *
   * @param {Found} other
   */
  claim(other) {
    this.#kept = { key: other.key, given: other.given, value: other.value };
    this.write(other.value);
    this.#drafts.forget(other);
  }
}
