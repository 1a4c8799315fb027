// Focus peaking: marks the finest detail. Only parts of the picture that are in focus have it.

const MARK_RGBA = [57, 255, 110, 255];

/** The measure does not exceed this value through noise alone. */
const NOISE = 40;

/**
 * Marks the pixels within `circle` that differ most from the mean of their four neighbours: more than four times as
 * much as the average pixel, and more than by noise alone. This difference is the Laplacian. It is small at a blurred
 * edge, however strong the edge. Computed from green, which carries most of the detail.
 *
 * @param {Uint8ClampedArray} rgba the picture, `width` by `height` pixels
 * @param {Uint8ClampedArray} marks receives the marks; of the same size, all zero
 * @param {number} width
 * @param {number} height
 * @param {Stream.Circle | null} circle
 */
export function markDetail(rgba, marks, width, height, circle) {
  const green = (/** @type {number} */ at) => rgba[at * 4 + 1] ?? 0;
  const details = new Uint16Array(width * height);
  let sum = 0;
  let count = 1;

  for (let y = 1; y < height - 1; y++) {
    const half = circle ? Math.sqrt(Math.max(0, circle.radius ** 2 - (y - circle.y) ** 2)) : width;
    const centre = circle?.x ?? 0;
    const first = Math.max(1, Math.ceil(centre - half));
    const end = Math.min(width - 1, Math.floor(centre + half));
    for (let x = first; x < end; x++) {
      const at = y * width + x;
      const neighbours = green(at - 1) + green(at + 1) + green(at - width) + green(at + width);
      const detail = Math.abs(4 * green(at) - neighbours);
      details[at] = detail;
      sum += detail;
      count += 1;
    }
  }

  const threshold = Math.max(NOISE, (4 * sum) / count);
  for (const [at, detail] of details.entries()) {
    if (detail > threshold) marks.set(MARK_RGBA, at * 4);
  }
}
