// The page asks for further pictures by acknowledging each one, once it is on screen. So a slow tablet or a poor network
// gets fewer pictures, but never old ones.

/**
 * Length of a frame message's first field. The field holds the length of the header: u16, little-endian.
 */
const LENGTH_BYTES = 2;

/**
 * Splits a frame message into its parts: length of the header, header (JSON), JPEG.
 *
 * @param {ArrayBuffer} message
 * @returns {{ header: Stream.Header, jpeg: Uint8Array<ArrayBuffer> }}
 */
export function readFrame(message) {
  const length = new DataView(message).getUint16(0, true);
  const header = new TextDecoder().decode(new Uint8Array(message, LENGTH_BYTES, length));
  return { header: JSON.parse(header), jpeg: new Uint8Array(message, LENGTH_BYTES + length) };
}

/**
 * @template Picture
 * @typedef {object} Page
 * @property {(jpeg: Uint8Array<ArrayBuffer>) => Promise<Picture>} decode
 * @property {(header: Stream.Header, picture: Picture, receivedAt: number) => void} draw
 * @property {(frame: number, held: number, shown: boolean) => void} acknowledge `held` is for how many milliseconds
 *   the page had the picture
 * @property {(error: unknown) => void} complain
 * @property {() => number} now milliseconds
 */

/**
 * Draws pictures in the order in which they arrive, and acknowledges each. Several may be under way at a time. If the
 * page falls behind, it draws only the newest.
 *
 * @template Picture
 */
export class Pictures {
  #page;
  /** @type {{ message: ArrayBuffer, receivedAt: number }[]} */
  #waiting = [];
  #isDrawing = false;

  /** @param {Page<Picture>} page */
  constructor(page) {
    this.#page = page;
  }

  /**
   * @param {ArrayBuffer} message
   * @param {number} [receivedAt] when it came, if not just now
   */
  async take(message, receivedAt = this.#page.now()) {
    this.#waiting.push({ message, receivedAt });
    if (this.#isDrawing) return;

    this.#isDrawing = true;
    for (let next = this.#waiting.shift(); next; next = this.#waiting.shift()) {
      await this.#draw(next.message, next.receivedAt, this.#waiting.length > 0);
    }
    this.#isDrawing = false;
  }

  /**
   * @param {ArrayBuffer} message
   * @param {number} receivedAt
   * @param {boolean} isOld whether a newer picture waits
   */
  async #draw(message, receivedAt, isOld) {
    const { decode, draw, acknowledge, complain, now } = this.#page;
    const { header, jpeg } = readFrame(message);
    let shown = false;
    try {
      if (!isOld) {
        draw(header, await decode(jpeg), receivedAt);
        shown = true;
      }
    } catch (error) {
      complain(error);
    }

    // A picture that could not be shown is acknowledged too: the next one may be good.
    acknowledge(header.frame, now() - receivedAt, shown);
  }
}
