// Whether the server is heard, and since when it is not.

/** A connection that is lost and back this soon was never missed. */
const BACK_SOON_MS = 2000;

/** The server says something at least every 5 s. One that says nothing for longer is missed. */
const SILENCE_MS = 7000;

/** @typedef {{ page: () => number, wall: () => number }} Clock both in milliseconds; anybody may set `wall` */

export class Contact {
  #clock;
  /** When the server was last heard, by the wall clock: this is shown to people. @type {number | null} */
  #heardAt;
  /** The same by the page's clock, which nobody can set; at first when the page was opened. */
  #heard;
  /** Whether there is no connection. A page begins without one. */
  #isLost = true;
  /** @type {number | null} */
  #certificateEnd;

  /**
   * @param {Clock} clock
   * @param {{ heardAt: number, certificateEnd: number | null } | null} earlier what an earlier load of the page knew,
   *   in milliseconds since 1970
   */
  constructor(clock, earlier) {
    this.#clock = clock;
    this.#heardAt = earlier?.heardAt ?? null;
    this.#certificateEnd = earlier?.certificateEnd ?? null;
    this.#heard = clock.page();
  }

  /** The server said something. */
  heard() {
    this.#heardAt = this.#clock.wall();
    this.#heard = this.#clock.page();
    this.#isLost = false;
  }

  /**
   * The server said until when its certificate is valid.
   *
   * @param {string | null} until
   */
  certifiedUntil(until) {
    this.#certificateEnd = until === null ? null : Date.parse(until);
  }

  /** The connection is gone. */
  lost() {
    this.#isLost = true;
  }

  /** When the server was last heard, in milliseconds since 1970; null if it never was. */
  get heardAt() {
    return this.#heardAt;
  }

  /** When the server's certificate ends, in milliseconds since 1970; null where it has none, or has not said. */
  get certificateEnd() {
    return this.#certificateEnd;
  }

  /**
   * Whether the server's certificate, as it was last told, has ended by this device's clock. A browser then refuses
   * the server as it refuses one that it does not trust.
   */
  get isCertificateOver() {
    return this.#certificateEnd !== null && this.#clock.wall() >= this.#certificateEnd;
  }

  /** Whether the server has not been heard for long enough to tell somebody. */
  get isMissed() {
    const silent = this.#clock.page() - this.#heard;
    return silent > (this.#isLost ? BACK_SOON_MS : SILENCE_MS);
  }
}
