// SVG shapes for the researcher's drawings.

const SVG = "http://www.w3.org/2000/svg";

/**
 * @param {string} tag
 * @param {Record<string, string | number>} attributes
 * @param {string} [text]
 */
export function shape(tag, attributes, text) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  if (text !== undefined) element.textContent = text;
  return element;
}

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
