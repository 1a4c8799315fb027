// Keeps comments and answers until the server confirms that they are saved. Every entry is first written to this
// device, under a key of its own, so that a reload, a Wi-Fi gap or a second tab loses nothing. Browsers write
// localStorage to the disk only some seconds later. A spare copy is on the disk at once, so that a tablet that loses
// its power loses nothing either. The entry's idempotency key makes sending it twice harmless, and its origin makes the
// order of sending harmless. What the server refuses also stays on this device, and is tried again when the page is
// next opened.

import { inWords, Refused } from "../shared/api.js";
import { say } from "../shared/language.js";
import { Delivery } from "./delivery.js";
import { READ_AGAIN_MS } from "./disk_store.js";

const PREFIX = "parfocal.outbox.";

/** An entry that is sent and not answered for so long is told as late. The request goes on. */
const LATE_MS = 2000;

/** @typedef {import("./origin.js").Stamp} Stamp */

/**
 * A comment or an answer. `slot` is the question that it answers, or null. `drafted` says whether another tab may send
 * the same draft under the same key. `stored` says whether this device keeps the entry over a reload.
 *
 * @typedef {object} Entry
 * @property {string} id sorts in the order of entry
 * @property {string} path
 * @property {string | null} slot
 * @property {Stamp} given
 * @property {boolean} drafted
 * @property {Record<string, any>} body
 * @property {boolean} [stored]
 * @property {boolean} [sending]
 * @property {string} [refusal] why the server refused it
 */

/**
 * A change of an entry's state. `late`: it was sent, and the server has not answered yet. `heard` says whether the
 * server answered.
 *
 * @typedef {object} Change
 * @property {Entry} entry
 * @property {"saving" | "late" | "saved" | "waiting" | "refused"} state
 * @property {string | null} reason
 * @property {boolean} heard
 */

/**
 * @typedef {object} Surroundings
 * @property {import("../shared/storage.js").Store} store available at once, in every tab
 * @property {import("./disk_store.js").DiskStore<Entry>} spare a copy that is on the disk itself
 * @property {import("./origin.js").Origins} origins
 * @property {(path: string, body: unknown) => Promise<void>} send resolves once the server has saved it
 * @property {() => string} newId
 * @property {() => number} wall milliseconds since 1970
 * @property {(run: () => void, ms: number) => () => void} later returns a function that cancels the call
 */

export class Outbox {
  /** Why the last attempt to send failed, or is late; null if it succeeded. @type {string | null} */
  trouble = null;

  /** Resolves once the entries that only the spare copy has are restored. @type {Promise<void>} */
  ready;

  #around;
  /** @type {Map<string, Entry>} */
  #entries = new Map();
  /** @type {Map<string, Entry>} */
  #refused = new Map();
  /** @type {Set<(change: Change) => void>} */
  #listeners = new Set();
  /** @type {Delivery<Entry>} */
  #delivery;
  #latest = 0;
  /** Ids of the entries that this page has removed from the device. @type {Set<string>} */
  #done = new Set();

  /** @param {Surroundings} around */
  constructor(around) {
    this.#around = around;
    const send = (/** @type {Entry} */ entry) => this.#send(entry);
    this.#delivery = new Delivery({ waiting: () => this.waiting, send, later: around.later });
    for (const entry of this.#stored()) this.#take(entry);
    this.ready = this.#restore();
    this.nudge();
  }

  /** @param {Entry} entry */
  #take(entry) {
    this.#entries.set(entry.id, entry);
    this.#latest = Math.max(this.#latest, Number.parseInt(entry.id, 10) || 0);
  }

  /** Sends what this device keeps, also what a closed tab has left. Each entry is saved only once. */
  wake() {
    for (const entry of this.#stored()) {
      const isKnown = this.#entries.has(entry.id) || this.#refused.has(entry.id) || this.#done.has(entry.id);
      if (isKnown) continue;
      this.#take(entry);
      this.#tell(entry, "saving");
    }
    this.nudge();
  }

  /** Restores entries that the device lost with its power. If one was already sent, the server recognises its key. */
  async #restore() {
    const left = await this.#around.spare.all();
    if (left === null) {
      this.#around.later(() => this.#restore(), READ_AGAIN_MS);
      return;
    }
    for (const entry of left) {
      const isElsewhere = this.#around.store.read(PREFIX + entry.id) !== null;
      if (isElsewhere || this.#done.has(entry.id) || this.#entries.has(entry.id)) continue;
      this.#take(entry);
      entry.stored = this.#store(entry);
      this.#tell(entry, "saving");
    }
    this.nudge();
  }

  /**
   * Calls `listener` whenever an entry is added, saved, refused, or could not be sent. Returns a function that ends the
   * subscription.
   *
   * @param {(change: Change) => void} listener
   */
  subscribe(listener) {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  }

  /** Whether this device keeps every unsaved entry over a reload. */
  get durable() {
    return [...this.#entries.values()].every(({ stored }) => stored);
  }

  /** Entries not yet saved, oldest first. */
  get waiting() {
    return [...this.#entries.values()].sort((a, b) => (a.id < b.id ? -1 : 1));
  }

  /**
   * The entries that the server refused and this device still keeps.
   *
   * @param {string} [session] only those of this session
   */
  refused(session) {
    return [...this.#refused.values()].filter(
      ({ body }) => session === undefined || body.session === session,
    );
  }

  /**
   * The number of entries of a session that this device holds in all its tabs, because they are not saved yet or were
   * refused.
   *
   * @param {string} session
   */
  held(session) {
    const entries = [...this.#stored(), ...this.#entries.values(), ...this.#refused.values()];
    const ofSession = entries.filter(({ body }) => body.session === session);
    return new Set(ofSession.map(({ id }) => id)).size;
  }

  /**
   * The sessions that entries of this page belong to.
   *
   * @returns {Set<string>}
   */
  get sessions() {
    const entries = [...this.#entries.values(), ...this.#refused.values()];
    return new Set(entries.map(({ body }) => body.session));
  }

  /**
   * Adds an entry that is to be sent to `path`.
   *
   * @param {string} path
   * @param {Record<string, unknown>} body
   * @param {string | null} [slot] the question that it answers, or null
   * @param {{ key?: string, given?: Stamp }} [from] the draft of this entry
   */
  add(path, body, slot = null, from = {}) {
    // If the clock is set back, later entries must still sort after earlier ones.
    this.#latest = Math.max(this.#around.wall(), this.#latest + 1);
    const { key = this.#around.newId(), given = this.#around.origins.stamp() } = from;

    /** @type {Entry} */
    const entry = {
      id: `${String(this.#latest).padStart(15, "0")}-${this.#around.newId()}`,
      path,
      slot,
      given,
      drafted: from.key !== undefined,
      body: { key, ...body },
    };

    if (slot) this.#forgetRefused(slot);
    this.#entries.set(entry.id, entry);
    entry.stored = this.#store(entry);
    this.#tell(entry, "saving");
    this.nudge();
    return entry;
  }

  /**
   * Forgets what the server refused for `slot`, because the surgeon has now given another answer.
   *
   * @param {string} slot
   */
  #forgetRefused(slot) {
    for (const entry of [...this.#refused.values()]) {
      if (entry.slot === slot) this.forget(entry);
    }
  }

  /**
   * The unsaved entries for `slot` and for its parts (`slot/part`), oldest first.
   *
   * @param {string} slot
   */
  pending(slot) {
    return this.waiting.filter((entry) => isFor(slot, entry));
  }

  /**
   * The refused entries for `slot` and for its parts that this device still keeps, oldest first.
   *
   * @param {string} slot
   */
  refusedFor(slot) {
    return this.refused().filter((entry) => isFor(slot, entry));
  }

  /** Tries to send now, without waiting any longer. */
  nudge() {
    this.#delivery.nudge();
  }

  /**
   * Waits until no entry for `path` is waiting, and returns true. Returns false as soon as such an entry could not be
   * sent, or the server did not answer.
   *
   * @param {string} path
   */
  async settled(path) {
    this.nudge();
    while (this.waiting.some((entry) => entry.path === path)) {
      const { entry, state, heard } = await this.#nextChange();
      if (state === "waiting" && (entry.path === path || !heard)) return false;
    }
    return true;
  }

  /** @returns {Promise<Change>} */
  #nextChange() {
    return new Promise((resolve) => {
      const end = this.subscribe((change) => {
        end();
        resolve(change);
      });
    });
  }

  /**
   * Sends one entry. Returns whether the server answered at all. If it did, the next entry is worth trying.
   *
   * @param {Entry} entry
   * @returns {Promise<boolean>}
   */
  async #send(entry) {
    entry.sending = true;
    const answered = this.#around.later(() => this.#late(entry), LATE_MS);
    try {
      await this.#around.send(entry.path, { ...entry.body, ...this.#around.origins.tell(entry.given) });
      this.trouble = null;
      this.forget(entry);
      this.#tell(entry, "saved");
      return true;
    } catch (error) {
      entry.sending = false;
      return this.#failed(entry, error);
    } finally {
      answered();
    }
  }

  /**
   * On a poor network a request may hang for long. What it carries is on this device already.
   *
   * @param {Entry} entry
   */
  #late(entry) {
    this.trouble = say("no-answer-yet");
    this.#tell(entry, "late", this.trouble, false);
  }

  /**
   * @param {Entry} entry
   * @param {unknown} error
   * @returns {Promise<boolean> | boolean}
   */
  #failed(entry, error) {
    if (error instanceof Refused && error.status === 409 && entry.drafted) {
      // Another tab has sent an earlier text of the same draft under this key. This text needs a key of its own.
      entry.drafted = false;
      entry.body.key = this.#around.newId();
      entry.stored = this.#store(entry);
      return this.#send(entry);
    }

    if (error instanceof Refused && error.final) {
      this.#entries.delete(entry.id);
      this.#refused.set(entry.id, entry);
      entry.refusal = error.message;
      this.#tell(entry, "refused", error.message);
      return true;
    }

    this.trouble = inWords(error, say("no-connection"));
    const heard = error instanceof Refused;
    this.#tell(entry, "waiting", this.trouble, heard);
    return heard;
  }

  /**
   * Another tab saved or replaced an entry that both tabs held.
   *
   * @param {string} name the entry's name in storage
   */
  doneElsewhere(name) {
    if (!name.startsWith(PREFIX)) return;
    const id = name.slice(PREFIX.length);
    const entry = this.#entries.get(id) ?? this.#refused.get(id);
    if (!entry || entry.sending) return;
    this.#entries.delete(id);
    this.#refused.delete(id);
    this.#tell(entry, "saved");
  }

  /**
   * Removes `entry` from this device, because it is saved, replaced, or back in its box.
   *
   * @param {Entry} entry
   */
  forget(entry) {
    this.#entries.delete(entry.id);
    this.#refused.delete(entry.id);
    this.#done.add(entry.id);
    this.#around.store.remove(PREFIX + entry.id);
    this.#around.spare.remove(entry.id);
  }

  /** @param {Entry} entry */
  #store(entry) {
    this.#around.spare.put({ ...entry, sending: false });
    return this.#around.store.write(PREFIX + entry.id, JSON.stringify(entry));
  }

  /** @returns {Entry[]} */
  #stored() {
    return this.#around.store.names(PREFIX).flatMap((name) => {
      try {
        const entry = JSON.parse(this.#around.store.read(name) ?? "");
        return [{ ...entry, sending: false, stored: true }];
      } catch {
        return [];
      }
    });
  }

  /**
   * @param {Entry} entry
   * @param {Change["state"]} state
   * @param {string | null} [reason]
   * @param {boolean} [heard]
   */
  #tell(entry, state, reason = null, heard = true) {
    for (const listener of [...this.#listeners]) listener({ entry, state, reason, heard });
  }
}

/**
 * Whether `entry` is for `slot` or for one of its parts.
 *
 * @param {string} slot
 * @param {Entry} entry
 */
function isFor(slot, entry) {
  return entry.slot === slot || entry.slot?.startsWith(`${slot}/`);
}
