// Keeps what was said until the server says that it is saved. Every entry is written to this device first, under a key of
// its own, so that a reload, a Wi-Fi gap or a second tab loses nothing; the entry's idempotency key makes sending it
// twice harmless, and what it tells of where and when it was said makes the order of sending harmless. What the server
// refuses stays on this device too, and is tried again when the page is next opened.

import { keep, Refused, inWords } from "../shared/api.js";
import { uuid } from "../shared/dom.js";
import { origin, stamp } from "./origin.js";

const PREFIX = "parfocal.outbox.";
const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 8000;

/** Fires `change` whenever an entry is added, saved or refused; the event's detail is `{ entry, state, reason, heard }`, `heard` whether the server
 * answered. */
export class Outbox extends EventTarget {
  #entries = new Map();
  #refused = new Map();
  #flushing = false;
  #wait = FIRST_WAIT_MS;
  #timer = null;
  #latest = 0;
  /** Why the last attempt failed, if it did. */
  trouble = null;

  constructor() {
    super();
    for (const entry of stored()) {
      this.#entries.set(entry.id, entry);
      this.#latest = Math.max(this.#latest, Number.parseInt(entry.id, 10) || 0);
    }
    addEventListener("storage", ({ key, newValue }) => key && newValue === null && this.#doneElsewhere(key));
    addEventListener("online", () => this.nudge());
    document.addEventListener("visibilitychange", () => document.hidden || this.nudge());
    addEventListener("beforeunload", (event) => {
      if (!this.durable && this.#entries.size > 0) event.preventDefault();
    });
    this.nudge();
  }

  /** Whether this device keeps every unsaved entry over a reload. */
  get durable() {
    return [...this.#entries.values()].every(({ stored }) => stored);
  }

  /** Entries not yet saved, oldest first. */
  get waiting() {
    return [...this.#entries.values()].sort((a, b) => (a.id < b.id ? -1 : 1));
  }

  /** What the server refused on `session` and this device still keeps. */
  refused(session) {
    return [...this.#refused.values()].filter(({ body }) => body.session === session);
  }

  /** How much of what was said in `session` this device holds, in all its tabs: not saved yet, or refused. */
  held(session) {
    const entries = [...stored(), ...this.#entries.values(), ...this.#refused.values()];
    return new Set(entries.filter(({ body }) => body.session === session).map(({ id }) => id)).size;
  }

  /** The sessions that entries of this page belong to. */
  get sessions() {
    return new Set([...this.#entries.values(), ...this.#refused.values()].map(({ body }) => body.session));
  }

  /**
   * Takes something to be sent to `path`; `slot` is the question that it answers, if it does. `from` is the `{ key, given }` of
   * the draft that it was written as, which another tab may send as well.
   */
  add(path, body, slot = null, from = {}) {
    // A clock that is set back must not put what is said later before what was said.
    this.#latest = Math.max(Date.now(), this.#latest + 1);
    const id = `${String(this.#latest).padStart(15, "0")}-${uuid()}`;
    const { key = uuid(), given = stamp() } = from;
    const entry = { id, path, slot, given, drafted: from.key !== undefined, body: { key, ...body } };
    // What the server cannot take is in the surgeon's hands again, who has now given another answer.
    if (slot) for (const other of [...this.#refused.values()]) if (other.slot === slot) this.forget(other);
    this.#entries.set(entry.id, entry);
    entry.stored = store(entry);
    this.#tell(entry, "saving");
    this.nudge();
    return entry;
  }

  /** The unsaved entries for `slot` and for the parts of it (`slot/part`), oldest first. */
  pending(slot) {
    return this.waiting.filter((entry) => entry.slot === slot || entry.slot?.startsWith(`${slot}/`));
  }

  /** Tries now rather than at the end of the present wait. */
  nudge() {
    clearTimeout(this.#timer);
    this.#wait = FIRST_WAIT_MS;
    this.#flush();
  }

  /** Waits until nothing for `path` waits: true; or until an attempt at such an entry failed, or the server was not heard: false. */
  async settled(path) {
    this.nudge();
    while (this.waiting.some((entry) => entry.path === path)) {
      const { entry, state, heard } = await new Promise((resolve) => this.addEventListener("change", (event) => resolve(event.detail), { once: true }));
      if (state === "waiting" && (entry.path === path || !heard)) return false;
    }
    return true;
  }

  async #flush() {
    if (this.#flushing) return;
    this.#flushing = true;
    const tried = new Set();
    const next = () => this.waiting.find((entry) => !tried.has(entry.id));
    for (let entry = next(); entry; entry = next()) {
      tried.add(entry.id);
      if (!(await this.#send(entry))) break;
    }
    this.#flushing = false;
    if (this.#entries.size > 0) {
      this.#timer = setTimeout(() => this.#flush(), this.#wait);
      this.#wait = Math.min(this.#wait * 2, LONGEST_WAIT_MS);
    }
  }

  /** Whether the server answered at all, so that the next entry is worth trying. */
  async #send(entry) {
    entry.sending = true;
    try {
      await keep(entry.path, { ...entry.body, ...told(entry) });
      this.trouble = null;
      this.forget(entry);
      this.#tell(entry, "saved");
      return true;
    } catch (error) {
      entry.sending = false;
      if (error instanceof Refused && error.status === 409 && entry.drafted) {
        // Another tab has sent an earlier text of the same draft under this key: this one is something else.
        entry.drafted = false;
        entry.body.key = uuid();
        entry.stored = store(entry);
        return this.#send(entry);
      }
      if (error instanceof Refused && error.final) {
        this.#entries.delete(entry.id);
        this.#refused.set(entry.id, entry);
        this.#tell(entry, "refused", error.message);
        return true;
      }
      this.trouble = inWords(error, "No connection: trying again by itself.");
      const heard = error instanceof Refused;
      this.#tell(entry, "waiting", this.trouble, heard);
      return heard;
    }
  }

  /** Another tab saved or replaced what both held. */
  #doneElsewhere(key) {
    const entry = this.#entries.get(key.slice(PREFIX.length));
    if (!key.startsWith(PREFIX) || !entry || entry.sending) return;
    this.#entries.delete(entry.id);
    this.#tell(entry, "saved");
  }

  /** Takes `entry` off this device: it is saved, replaced, or in a person's hands again. */
  forget(entry) {
    this.#entries.delete(entry.id);
    this.#refused.delete(entry.id);
    try {
      localStorage.removeItem(PREFIX + entry.id);
    } catch {
      // storage switched off: there was nothing to remove
    }
  }

  #tell(entry, state, reason = null, heard = true) {
    this.dispatchEvent(new CustomEvent("change", { detail: { entry, state, reason, heard } }));
  }
}

/** Where and when `entry` was said. Entries of an older page tell no more than the wall clock, and answers not even that. */
function told({ given, body }) {
  if (given) return origin(given);
  return body.client_millis === undefined ? {} : origin({ client_millis: body.client_millis });
}

function store(entry) {
  try {
    localStorage.setItem(PREFIX + entry.id, JSON.stringify(entry));
    return true;
  } catch {
    return false;
  }
}

function stored() {
  try {
    return Object.keys(localStorage)
      .filter((key) => key.startsWith(PREFIX))
      .flatMap((key) => parsed(localStorage.getItem(key)));
  } catch {
    return [];
  }
}

function parsed(text) {
  try {
    return [{ ...JSON.parse(text), sending: false, stored: true }];
  } catch {
    return [];
  }
}
