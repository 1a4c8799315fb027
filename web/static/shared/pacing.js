// The page asks for the next picture by acknowledging the previous one, once that is on screen. So a slow tablet or a
// poor network gets fewer pictures, but never old ones.

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
 * Decodes and draws the picture of `message`, then acknowledges it.
 *
 * @template Picture
 * @param {ArrayBuffer} message
 * @param {object} page
 * @param {(jpeg: Uint8Array<ArrayBuffer>) => Promise<Picture>} page.decode
 * @param {(header: Stream.Header, picture: Picture) => void} page.draw
 * @param {(frame: number) => void} page.acknowledge
 * @param {(error: unknown) => void} page.complain
 */
export async function drawAndAcknowledge(message, { decode, draw, acknowledge, complain }) {
  const { header, jpeg } = readFrame(message);
  try {
    draw(header, await decode(jpeg));
  } catch (error) {
    complain(error);
  }

  // A picture that could not be shown is acknowledged too: the next one may be good.
  acknowledge(header.frame);
}
