// The live view: mountViewer(element, { role }) draws the stream into `element`.

import { Live } from "./live.js";

/**
 * @param {HTMLElement} element
 * @param {{role: "surgeon"|"operator"|"researcher"}} options
 * @returns {{live: Live, frame: number|null}} `live` emits "session", "status" and "connection"; `frame` is the number
 *   of the frame on screen.
 */
export function mountViewer(element, { role }) {
  const canvas = document.createElement("canvas");
  element.append(canvas);
  const context = canvas.getContext("2d", { alpha: false });
  const live = new Live(role);
  const viewer = { live, frame: null };
  live.addEventListener("frame", ({ detail: { header, bitmap } }) => {
    if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) {
      canvas.width = bitmap.width;
      canvas.height = bitmap.height;
    }
    context.drawImage(bitmap, 0, 0);
    viewer.frame = header.frame;
  });
  return viewer;
}
