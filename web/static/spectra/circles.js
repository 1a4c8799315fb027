// Draws the places on the picture: a circle around what is measured, with the place's mark and number, and the cross
// that the keyboard moves. `scale` is screen pixels per mosaic cell, `line` a line's width in screen pixels.

import { stroke } from "../shared/overlay.js";
import { LOOKS, markPath } from "./looks.js";
import { SAMPLES } from "./places.js";

const CROSS_COLOUR = "#ffffff";

/** Half of the cross's width, and of the gap in its middle, in widths of a line. */
const CROSS = 14;
const GAP = 4;

/**
 * @param {CanvasRenderingContext2D} context
 * @param {import("./places.js").Places} places
 * @param {number} scale
 * @param {number} line
 */
export function drawCircles(context, places, scale, line) {
  const perSample = scale / SAMPLES;
  for (const { look, x, y } of places.all) {
    const { dark, mark } = LOOKS[look] ?? { dark: CROSS_COLOUR, mark: "circle" };
    const centre = { x: x * perSample, y: y * perSample };
    const radius = places.radius * perSample;
    stroke(context, dark, 1.5 * line, () => {
      context.arc(centre.x, centre.y, Math.max(radius, 2 * line), 0, 2 * Math.PI);
    });

    // The mark stands beside the circle, so that it hides nothing of what is measured.
    const beside = centre.x + Math.max(radius, 2 * line) + 8 * line;
    const path = new Path2D(markPath(mark, beside, centre.y, 3.5 * line));
    outlined(context, dark, line, path);
    context.font = `600 ${11 * line}px system-ui, sans-serif`;
    context.textBaseline = "middle";
    context.lineWidth = 2.5 * line;
    context.strokeStyle = "rgba(0, 0, 0, .7)";
    context.strokeText(String(look + 1), beside + 7 * line, centre.y);
    context.fillText(String(look + 1), beside + 7 * line, centre.y);
  }
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {string} colour
 * @param {number} line
 * @param {Path2D} path
 */
function outlined(context, colour, line, path) {
  context.lineWidth = 3.5 * line;
  context.strokeStyle = "rgba(0, 0, 0, .7)";
  context.stroke(path);
  context.lineWidth = 1.5 * line;
  context.strokeStyle = colour;
  context.stroke(path);
  context.fillStyle = colour;
  context.fill(path);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {import("./cross.js").Cell} at
 * @param {number} scale
 * @param {number} line
 */
export function drawCross(context, at, scale, line) {
  const x = at.x * scale;
  const y = at.y * scale;
  stroke(context, CROSS_COLOUR, line, () => {
    for (const [dx, dy] of [
      [1, 0],
      [-1, 0],
      [0, 1],
      [0, -1],
    ]) {
      context.moveTo(x + GAP * line * (dx ?? 0), y + GAP * line * (dy ?? 0));
      context.lineTo(x + CROSS * line * (dx ?? 0), y + CROSS * line * (dy ?? 0));
    }
  });
}
