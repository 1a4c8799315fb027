// The line that shows where playback is.

import { shape } from "../shared/svg.js";

/**
 * A vertical line that shows where playback is. It is hidden until it is first moved.
 *
 * @param {{ top: number, bottom: number }} edges
 */
export function playheadLine({ top, bottom }) {
  return shape("line", { class: "playhead", y1: top, y2: bottom, x1: 0, x2: 0, visibility: "hidden" });
}

/**
 * @param {Element} line
 * @param {number} x
 */
export function movePlayhead(line, x) {
  line.setAttribute("x1", x.toFixed(1));
  line.setAttribute("x2", x.toFixed(1));
  line.setAttribute("visibility", "visible");
}
