// Where and when something is entered: on which device, with which sequence number there, and how long ago. An entry may
// wait for the network. Its wait is measured by the page's monotonic clock, which nobody can set.

const DEVICE = "parfocal.device";
const SEQUENCE = "parfocal.sequence";

/**
 * A tablet that loses its power forgets the sequence numbers that it gave in its last seconds. So each load of the page
 * leaves out this many numbers, so that none is given twice.
 */
const LEFT_OUT = 1000;

/**
 * The page's clock and the wall clock may drift apart by this much while the page is hidden. If they differ by more,
 * the device slept, or its clock was set.
 */
const DRIFT_MS = 1000;

/**
 * @typedef {object} Clock
 * @property {() => number} page milliseconds since this page was loaded; stands still while the device sleeps
 * @property {() => number} wall milliseconds since 1970; people can set it
 */

/**
 * Kept with every entry.
 *
 * @typedef {object} Stamp
 * @property {string} device
 * @property {number} sequence
 * @property {number} client_millis
 * @property {{ page: string, at: number, slept: number }} clock
 */

export class Origins {
  #store;
  #clock;
  /** This load of the page: only two readings of one page's clock can be compared. */
  #page;
  /**
   * The device's name if nothing can be stored. Then each load of the page counts as a device of its own.
   */
  #ownDevice;
  #latest = 0;
  /**
   * For how long, in milliseconds, the page's clock stood still while the device slept, judged by the wall clock.
   */
  #slept = 0;
  /** @type {{ page: number, wall: number } | null} */
  #hiddenSince = null;

  /**
   * @param {import("../shared/storage.js").Store} store
   * @param {Clock} clock
   * @param {() => string} newId
   */
  constructor(store, clock, newId) {
    this.#store = store;
    this.#clock = clock;
    this.#page = newId();
    this.#ownDevice = newId();
  }

  /**
   * Call this when the page is hidden or shown again: the device may have slept in between.
   *
   * @param {boolean} hidden
   */
  sight(hidden) {
    const page = this.#clock.page();
    const wall = this.#clock.wall();
    if (!hidden && this.#hiddenSince) {
      const gap = wall - this.#hiddenSince.wall - (page - this.#hiddenSince.page);
      if (gap > DRIFT_MS) this.#slept += gap;
    }
    this.#hiddenSince = hidden ? { page, wall } : null;
  }

  /** The name of this device: the same in all tabs of its browser. */
  device() {
    const known = this.#store.read(DEVICE);
    if (known) return known;

    // Another tab may have been first.
    this.#store.write(DEVICE, this.#ownDevice);
    this.#ownDevice = this.#store.read(DEVICE) ?? this.#ownDevice;
    return this.#ownDevice;
  }

  #next() {
    const known = Number(this.#store.read(SEQUENCE)) || 0;
    const isFirst = this.#latest === 0 && known > 0;
    this.#latest = Math.max(this.#latest, known) + (isFirst ? LEFT_OUT : 1);
    this.#store.write(SEQUENCE, String(this.#latest));
    return this.#latest;
  }

  /**
   * A stamp to keep with an entry made now.
   *
   * @returns {Stamp}
   */
  stamp() {
    return {
      device: this.device(),
      sequence: this.#next(),
      client_millis: this.#clock.wall(),
      clock: { page: this.#page, at: this.#clock.page(), slept: this.#slept },
    };
  }

  /**
   * The stamp in the form in which it is sent to the server, at the moment of sending.
   *
   * @param {Stamp} stamp
   * @returns {Api.Origin}
   */
  tell({ clock, ...sent }) {
    const onThisPage = clock.page === this.#page ? clock : null;
    const waited = onThisPage
      ? this.#clock.page() - onThisPage.at + this.#slept - onThisPage.slept
      : this.#clock.wall() - sent.client_millis;
    const awake = onThisPage !== null && this.#slept === onThisPage.slept;

    return {
      ...sent,
      waited_millis: Math.max(0, Math.round(waited)),
      waited_by: awake ? "page-clock" : "wall-clock",
    };
  }
}
