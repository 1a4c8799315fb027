// Overlays drawn on the picture. `scale` is screen pixels per mosaic cell, `line` a line's width in screen pixels.

import { contextOf } from "./canvas.js";
import { markDetail } from "./peaking.js";

const PATCH_COLOUR = "#5cf2ff";
const AREA_COLOUR = "#ffffff";

/** Wider pictures are reduced to this width before the search for detail, to save time. */
const PEAKING_WIDTH = 640;

/** Pixels at the edge of the content area that are not searched, because the edge itself is sharp. */
const PEAKING_MARGIN = 8;

/**
 * Draws a line that is visible on dark and on bright parts of the picture.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {string} colour
 * @param {number} width
 * @param {() => void} path
 */
export function stroke(context, colour, width, path) {
  const shadow = { style: "rgba(0, 0, 0, .55)", lineWidth: width * 2.2 };
  for (const { style, lineWidth } of [shadow, { style: colour, lineWidth: width }]) {
    context.strokeStyle = style;
    context.lineWidth = lineWidth;
    context.beginPath();
    path();
    context.stroke();
  }
}

/**
 * Draws the four corners of the patch in which the focus is measured.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {Stream.Patch} patch
 * @param {number} scale
 * @param {number} line
 */
export function drawPatch(context, patch, scale, line) {
  const left = patch.x * scale;
  const top = patch.y * scale;
  const right = left + patch.width * scale;
  const bottom = top + patch.height * scale;
  const arm = (right - left) / 4;

  /** @type {[number, number, number, number][]} */
  const corners = [
    [left, top, 1, 1],
    [right, top, -1, 1],
    [right, bottom, -1, -1],
    [left, bottom, 1, -1],
  ];
  stroke(context, PATCH_COLOUR, line, () => {
    for (const [x, y, dx, dy] of corners) {
      context.moveTo(x + dx * arm, y);
      context.lineTo(x, y);
      context.lineTo(x, y + dy * arm);
    }
  });
}

/**
 * Draws a ring around the place that somebody has pointed at.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {{ x: number, y: number }} at
 * @param {Stream.Patch} patch
 * @param {number} scale
 * @param {number} line
 */
export function drawRing(context, at, patch, scale, line) {
  stroke(context, PATCH_COLOUR, 2 * line, () => {
    context.arc(at.x * scale, at.y * scale, 0.8 * patch.width * scale, 0, 2 * Math.PI);
  });
}

/**
 * Draws the content area: the circle that holds the picture.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {Stream.Circle} area
 * @param {number} scale
 * @param {number} line
 */
export function drawContentArea(context, area, scale, line) {
  context.setLineDash([4 * line, 4 * line]);
  stroke(context, AREA_COLOUR, line, () => {
    context.arc(area.x * scale, area.y * scale, area.radius * scale, 0, 2 * Math.PI);
  });
  context.setLineDash([]);
}

/** Focus peaking of the latest picture. */
export class Peaking {
  #reader = contextOf(document.createElement("canvas"), { willReadFrequently: true, alpha: false });
  #marks = contextOf(document.createElement("canvas"));

  /**
   * Searches a new picture of `cells` for detail. The search runs at a size that depends on `cells` alone, so what
   * counts as sharp does not depend on the size that the server sends. Outside the circle `area`, if there is one,
   * there is nothing to see.
   *
   * @param {ImageBitmap} bitmap
   * @param {import("./fit.js").Extent} cells
   * @param {Stream.Circle | null} area
   */
  look(bitmap, cells, area) {
    const scale = Math.min(1, PEAKING_WIDTH / cells.width);
    const width = Math.round(cells.width * scale);
    const height = Math.round(cells.height * scale);
    for (const { canvas } of [this.#reader, this.#marks]) {
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    }

    this.#reader.imageSmoothingQuality = "high";
    this.#reader.drawImage(bitmap, 0, 0, width, height);
    const { data } = this.#reader.getImageData(0, 0, width, height);
    const marks = this.#marks.createImageData(width, height);
    const circle = area && {
      x: area.x * scale,
      y: area.y * scale,
      radius: area.radius * scale - PEAKING_MARGIN,
    };
    markDetail(data, marks.data, width, height, circle);
    this.#marks.putImageData(marks, 0, 0);
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {number} width
   * @param {number} height
   */
  draw(context, width, height) {
    context.imageSmoothingEnabled = false;
    context.drawImage(this.#marks.canvas, 0, 0, width, height);
  }
}
