// Whether the server has been heard recently, and when it was last heard.

/** A lost connection is reported only if the server stays silent for longer than this. */
const BACK_SOON_MS = 2000;

/** The server sends something at least every 5 s. An open connection that is silent for longer is reported. */
const SILENCE_MS = 7000;

/** @typedef {{ page: () => number, wall: () => number }} Clock both in milliseconds; people can set `wall` */

export class Contact {
  #clock;
  /** When the server was last heard, by the wall clock. This is shown to people. @type {number | null} */
  #heardAt;
  /** The same by the page's clock, which nobody can set. Initially the time when the page was opened. */
  #heard;
  /** Whether there is no connection. A page begins without one. */
  #isLost = true;
  /** @type {number | null} */
  #certificateEnd;

  /**
   * @param {Clock} clock
   * @param {{ heardAt: number, certificateEnd: number | null } | null} earlier the values of an earlier load of the
   *   page, in milliseconds since 1970
   */
  constructor(clock, earlier) {
    this.#clock = clock;
    this.#heardAt = earlier?.heardAt ?? null;
    this.#certificateEnd = earlier?.certificateEnd ?? null;
    this.#heard = clock.page();
  }

  /** Call this whenever the server sends something. */
  heard() {
    this.#heardAt = this.#clock.wall();
    this.#heard = this.#clock.page();
    this.#isLost = false;
  }

  /**
   * The server announced until when its certificate is valid.
   *
   * @param {string | null} until a date that `Date.parse` reads; null if the server has no certificate
   */
  certifiedUntil(until) {
    this.#certificateEnd = until === null ? null : Date.parse(until);
  }

  /** Call this when the connection is lost. */
  lost() {
    this.#isLost = true;
  }

  /** When the server was last heard, in milliseconds since 1970; null if it never was. */
  get heardAt() {
    return this.#heardAt;
  }

  /** When the server's certificate ends, in milliseconds since 1970; null if it has none or is not known yet. */
  get certificateEnd() {
    return this.#certificateEnd;
  }

  /**
   * Whether the server's certificate has ended by this device's clock, as far as this page knows. The browser then
   * refuses the server like any server that it does not trust.
   */
  get isCertificateOver() {
    return this.#certificateEnd !== null && this.#clock.wall() >= this.#certificateEnd;
  }

  /** Whether the server has been silent for so long that somebody should know. */
  get isMissed() {
    const silent = this.#clock.page() - this.#heard;
    return silent > (this.#isLost ? BACK_SOON_MS : SILENCE_MS);
  }
}
