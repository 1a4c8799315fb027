// Keeps what was said until the server says that it is saved. Every entry is written to this device first, under a key of
// its own, so that a reload, a Wi-Fi gap or a second tab loses nothing; the entry's idempotency key makes sending it
// twice harmless. What the server refuses stays on this device too, and is tried again when the page is next opened.

import { keep, Refused, inWords } from "./api.js";
import { uuid } from "./dom.js";

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

  /**
   * Takes something to be sent to `path`. An entry with the same `slot` (a question) that has not left yet is replaced.
   * `body.key` is made here.
   */
  add(path, body, slot = null) {
    // A clock that is set back must not put what is said later before what was said.
    this.#latest = Math.max(Date.now(), this.#latest + 1);
    const entry = { id: `${String(this.#latest).padStart(15, "0")}-${uuid()}`, path, slot, body: { key: uuid(), ...body } };
    if (slot) {
      for (const other of [...this.waiting, ...this.#refused.values()]) if (other.slot === slot && !other.sending) this.forget(other);
    }
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
      await keep(entry.path, withWait(entry.body));
      this.trouble = null;
      this.forget(entry);
      this.#tell(entry, "saved");
      return true;
    } catch (error) {
      entry.sending = false;
      if (error instanceof Refused && error.final) {
        this.#entries.delete(entry.id);
        this.#refused.set(entry.id, entry);
        this.#tell(entry, "refused", error.message);
        return true;
      }
      this.trouble = inWords(error, "No connection: trying again by itself.");
      // Tried again later it would be the last to arrive, and count.
      if (this.#replaced(entry)) this.forget(entry);
      const heard = error instanceof Refused;
      this.#tell(entry, "waiting", this.trouble, heard);
      return heard;
    }
  }

  #replaced({ id, slot }) {
    return slot !== null && this.waiting.some((other) => other.slot === slot && other.id > id);
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

/** What says when it was said also says how long it has waited since. */
function withWait(body) {
  return body.client_millis === undefined ? body : { ...body, waited_millis: Math.max(0, Date.now() - body.client_millis) };
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

/** The drafts on this device whose names begin with `start`, as `[rest of the name, value]`. */
export function draftsOf(start) {
  const prefix = `parfocal.draft.${start}`;
  const names = ["sessionStorage", "localStorage"].flatMap((storage) => {
    try {
      return Object.keys(window[storage]).filter((key) => key.startsWith(prefix));
    } catch {
      return [];
    }
  });
  return [...new Set(names)].map((key) => [key.slice(prefix.length), new Draft(key.slice("parfocal.draft.".length)).read()]);
}

/** A text being written, kept on this device: per tab over a reload, and for the next tab when this one is closed. */
export class Draft {
  #name;
  constructor(name) {
    this.#name = `parfocal.draft.${name}`;
  }

  /** What was being written, or null. */
  read() {
    try {
      return JSON.parse(sessionStorage.getItem(this.#name) ?? localStorage.getItem(this.#name));
    } catch {
      return null;
    }
  }

  /** Keeps `value`; null forgets it. */
  write(value) {
    for (const storage of ["sessionStorage", "localStorage"]) {
      try {
        if (value === null) window[storage].removeItem(this.#name);
        else window[storage].setItem(this.#name, JSON.stringify(value));
      } catch {
        // full or switched off: the text is still in its box
      }
    }
  }
}
