// Draws the depth map on the picture: at each place where its optimum is, seen from the lens.

import { stroke } from "../shared/overlay.js";

const COLOURS = {
  "in-focus": "#7dff9b",
  higher: "#ffd23f",
  lower: "#ff9de1",
  unknown: "rgba(255, 255, 255, .8)",
};
const EDGE_COLOUR = "rgba(0, 0, 0, .75)";

/** Sizes of the marks, in widths of a line. */
const DISC = 4;
const TRIANGLE = 5;
const RING = 2.2;

/** @type {import("../shared/viewer.js").Draw} */
export function drawDepths(context, { depths }, pixels, line) {
  for (const { x, y, side } of depths?.places ?? [])
    drawPlace(context, { x: x * pixels, y: y * pixels }, side, line);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {{ x: number, y: number }} at in screen pixels
 * @param {Stream.PlaceDepth["side"]} side
 * @param {number} line
 */
function drawPlace(context, { x, y }, side, line) {
  const circle = (/** @type {number} */ radius) => () => context.arc(x, y, radius * line, 0, 2 * Math.PI);
  if (side === "unknown") stroke(context, COLOURS[side], line / 2, circle(RING));
  else if (side === "in-focus") fill(context, COLOURS[side], line, circle(DISC));
  else
    fill(context, COLOURS[side], line, () =>
      triangle(context, x, y, (side === "higher" ? -1 : 1) * TRIANGLE * line),
    );
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {string} colour
 * @param {number} line
 * @param {() => void} path
 */
function fill(context, colour, line, path) {
  context.beginPath();
  path();
  context.closePath();
  context.lineWidth = line;
  context.strokeStyle = EDGE_COLOUR;
  context.stroke();
  context.fillStyle = colour;
  context.fill();
}

/**
 * The path of a triangle around (x, y), whose tip is `tip` pixels below it (above it, if negative).
 *
 * @param {CanvasRenderingContext2D} context
 * @param {number} x
 * @param {number} y
 * @param {number} tip
 */
function triangle(context, x, y, tip) {
  const half = Math.abs(tip);
  context.moveTo(x, y + tip);
  context.lineTo(x + half, y - 0.7 * tip);
  context.lineTo(x - half, y - 0.7 * tip);
}
