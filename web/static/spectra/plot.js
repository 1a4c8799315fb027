// Draws spectra as SVG: a line through the means of each place, its spread as an area, a mark at each band. All colours
// are attributes, so that the drawing looks the same once it is saved.

import { shape } from "../shared/svg.js";
import { LOOKS, markPath } from "./looks.js";
import { PlotScale } from "./scale.js";
import { levelOf } from "./table.js";
import { numberOf, plotWords, whereWords } from "./words.js";

/** @typedef {import("./table.js").Measured} Measured */
/** @typedef {import("./table.js").Unit} Unit */

/** The text's size, in pixels. Where it is enlarged, everything in the plot is. */
const TEXT = 13;

/** Space for the texts around the plot. */
const EDGE = { left: 58, right: 14, top: 30, bottom: 46 };

/** The height of a line of the key. */
const KEY_LINE = 20;

const MARK = 4;

/**
 * @typedef {object} Paper
 * @property {"dark" | "light"} look which of a place's colours is used
 * @property {string} ground
 * @property {string} text
 * @property {string} grid
 */

/** The page, and white paper. @type {Record<"page" | "paper", Paper>} */
export const PAPERS = {
  page: { look: "dark", ground: "none", text: "#a3b1bb", grid: "#2b3842" },
  paper: { look: "light", ground: "#ffffff", text: "#333333", grid: "#dddddd" },
};

/**
 * The plot of `measured`.
 *
 * @param {Measured[]} measured
 * @param {Unit} unit
 * @param {object} options
 * @param {number} options.width pixels
 * @param {number} options.height pixels
 * @param {Paper} options.paper
 * @param {number} [options.enlarged] how many times larger than usual the text is
 * @param {string} [options.caption] with a caption, the plot has a key that names the places
 */
export function drawPlot(measured, unit, { width: full, height: whole, paper, enlarged = 1, caption }) {
  const width = full / enlarged;
  const height = whole / enlarged;
  const keyHeight = caption === undefined ? 0 : (measured.length + 1) * KEY_LINE + 8;
  const box = {
    left: EDGE.left,
    right: width - EDGE.right,
    top: EDGE.top + keyHeight,
    bottom: height - EDGE.bottom,
  };
  const scale = new PlotScale(measured, unit, box);

  const svg = shape("svg", {
    xmlns: "http://www.w3.org/2000/svg",
    viewBox: `0 0 ${width} ${height}`,
    width: full,
    height: whole,
    role: "img",
    "aria-label": plotWords(measured, unit),
    "font-family": "system-ui, sans-serif",
    "font-size": TEXT,
  });
  if (paper.ground !== "none") svg.append(shape("rect", { width, height, fill: paper.ground }));
  svg.append(
    ...axes(scale, unit, box, paper),
    ...measured.map((one) => spreadArea(one, unit, scale, paper)),
    ...measured.flatMap((one) => meanLine(one, unit, scale, paper)),
    ...(caption === undefined ? [] : key(measured, caption, paper)),
  );
  return svg;
}

/**
 * @param {PlotScale} scale
 * @param {Unit} unit
 * @param {import("./scale.js").Box} box
 * @param {Paper} paper
 */
function axes(scale, unit, { left, right, top, bottom }, { text, grid }) {
  const parts = [];
  for (const value of scale.values) {
    const y = scale.y(value).toFixed(1);
    parts.push(
      shape("line", { x1: left, x2: right, y1: y, y2: y, stroke: grid }),
      shape("text", { x: left - 8, y: Number(y) + 4, "text-anchor": "end", fill: text }, String(value)),
    );
  }
  for (const nm of scale.wavelengths) {
    const x = scale.x(nm).toFixed(1);
    parts.push(
      shape("line", { x1: x, x2: x, y1: bottom, y2: bottom + 5, stroke: text }),
      shape("text", { x, y: bottom + 20, "text-anchor": "middle", fill: text }, String(nm)),
    );
  }
  const middle = (left + right) / 2;
  parts.push(
    shape("line", { x1: left, x2: right, y1: scale.y(0), y2: scale.y(0), stroke: text }),
    shape("text", { x: middle, y: bottom + 40, "text-anchor": "middle", fill: text }, "wavelength (nm)"),
    shape("text", { x: 4, y: top - 14, fill: text }, unit),
  );
  return parts;
}

/**
 * @param {Measured} measured
 * @param {Unit} unit
 * @param {PlotScale} scale
 * @param {Paper} paper
 */
function spreadArea({ place, spectrum }, unit, scale, paper) {
  const fill = LOOKS[place.look]?.[paper.look] ?? paper.text;
  return shape("path", { class: "spread", d: scale.area(spectrum, unit), fill, "fill-opacity": 0.15 });
}

/**
 * @param {Measured} measured
 * @param {Unit} unit
 * @param {PlotScale} scale
 * @param {Paper} paper
 */
function meanLine({ place, spectrum }, unit, scale, paper) {
  const stroke = LOOKS[place.look]?.[paper.look] ?? paper.text;
  const line = { class: "mean", d: scale.line(spectrum, unit), fill: "none", stroke, "stroke-width": 2 };
  const marks = spectrum.bands.map((band) =>
    mark(place.look, scale.x(band.wavelength_nm), scale.y(levelOf(band, unit).mean), paper),
  );
  return [shape("path", line), ...marks];
}

/**
 * A place's mark, as the plot, its key and the list of places have it.
 *
 * @param {number} look
 * @param {number} x
 * @param {number} y
 * @param {Paper} paper
 * @param {number} [size]
 */
export function mark(look, x, y, paper, size = MARK) {
  const { [paper.look]: colour, mark } = LOOKS[look] ?? {
    dark: paper.text,
    light: paper.text,
    mark: "circle",
  };
  return shape("path", { d: markPath(mark, x, y, size), fill: colour, stroke: colour, "stroke-width": 1.5 });
}

/**
 * @param {Measured[]} measured
 * @param {string} caption
 * @param {Paper} paper
 */
function key(measured, caption, paper) {
  const lines = measured.flatMap((one, index) => {
    const y = (index + 2) * KEY_LINE;
    const words = `${numberOf(one.place)}: ${whereWords(one.place)}`;
    return [mark(one.place.look, 18, y - 4, paper), shape("text", { x: 32, y, fill: paper.text }, words)];
  });
  return [shape("text", { x: 12, y: KEY_LINE, fill: paper.text }, caption), ...lines];
}
