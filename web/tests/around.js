// Replacements for parts of the browser and the server, with which the tests run the pages' logic.

/** The surgeon's view in the middle of a setting. @type {Api.SurgeonView} */
export const VIEW = {
  session: "s",
  phase: "inspecting",
  paused: false,
  may_resume: false,
  may_pause: true,
  unrecorded: false,
  practice: false,
  language: "en",
  title: "Trial",
  segment: "a",
  setting: 2,
  settings: 6,
  remaining_seconds: 31.5,
  prompt: "How does it feel now?",
  quick_comments: [],
  voice: false,
  pointing: false,
  holding: false,
  focus_held: false,
  questions: [],
  answers: {},
  comments: 3,
  said: [],
};

/**
 * A browser's storage. `full` makes every write fail.
 *
 * @returns {import("../static/shared/storage.js").Store & { full: boolean, kept: Map<string, string> }}
 */
export function fakeStore() {
  const kept = new Map();
  return {
    full: false,
    kept,
    read: (name) => kept.get(name) ?? null,
    write(name, text) {
      if (this.full) return false;
      kept.set(name, text);
      return true;
    },
    remove: (name) => kept.delete(name),
    names: (prefix) => [...kept.keys()].filter((name) => name.startsWith(prefix)),
  };
}

/**
 * A device's disk. `full` makes every write fail, `unreadable` every reading. While it is `busy`, nothing that is written
 * reaches it.
 *
 * @template {{ id: string }} Thing
 */
export class FakeDisk {
  full = false;
  unreadable = false;
  /** @type {Promise<void>} */
  busy = Promise.resolve();
  /** @type {Map<string, Thing>} */
  kept = new Map();

  all = async () => (this.unreadable ? null : [...this.kept.values()]);

  put = async (/** @type {Thing} */ thing) => {
    await this.busy;
    if (!this.full) this.kept.set(thing.id, thing);
    return !this.full;
  };

  remove = async (/** @type {string} */ id) => {
    this.kept.delete(id);
  };
}

/** Both clocks of a page, and its timers. Nothing moves unless a test says so. */
export class FakeTime {
  pageMillis = 1_000;
  wallMillis = 1_700_000_000_000;
  /** @type {{ at: number, run: () => void }[]} */
  #timers = [];

  page = () => this.pageMillis;
  wall = () => this.wallMillis;

  later = (/** @type {() => void} */ run, /** @type {number} */ ms) => {
    const timer = { at: this.pageMillis + ms, run };
    this.#timers.push(timer);
    return () => {
      this.#timers = this.#timers.filter((other) => other !== timer);
    };
  };

  /** Milliseconds until the next timer runs out; null if none is set. */
  get nextIn() {
    const times = this.#timers.map(({ at }) => at - this.pageMillis);
    return times.length === 0 ? null : Math.min(...times);
  }

  /**
   * Lets time pass, and runs the timers that run out.
   *
   * @param {number} ms
   */
  async pass(ms) {
    this.pageMillis += ms;
    this.wallMillis += ms;
    const due = this.#timers.filter(({ at }) => at <= this.pageMillis);
    this.#timers = this.#timers.filter(({ at }) => at > this.pageMillis);
    for (const { run } of due) run();
    await settle();
  }
}

/** Waits until all promises that are ready to continue have done so. */
export function settle() {
  return new Promise((resolve) => setImmediate(resolve));
}

/** Generates distinct identifiers: `id-1`, `id-2`, and so on. */
export function countedIds() {
  let count = 0;
  return () => {
    count += 1;
    return `id-${count}`;
  };
}

/** A server whose answers a test sets. Without answers it accepts everything. */
export class FakeServer {
  /** @type {{ path: string, body: any }[]} */
  got = [];
  /**
   * The answers, in order, perhaps yet to come: an error to throw, or null to accept what was sent.
   *
   * @type {(Error | null | Promise<Error | null>)[]}
   */
  answers = [];

  send = async (/** @type {string} */ path, /** @type {any} */ body) => {
    this.got.push({ path, body: structuredClone(body) });
    const answer = await this.answers.shift();
    if (answer) throw answer;
  };
}
