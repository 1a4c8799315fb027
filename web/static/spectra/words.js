// Texts about spectra.

import { counted } from "../shared/text.js";

/** @typedef {import("./table.js").Measured} Measured */
/** @typedef {import("./table.js").Unit} Unit */
/** @typedef {import("./places.js").Place} Place */

/** @param {Place} place */
export function numberOf(place) {
  return place.look + 1;
}

/**
 * `x 1024, y 544`, in whole samples.
 *
 * @param {Place} place
 */
export function whereWords({ x, y }) {
  return `x ${Math.floor(x)}, y ${Math.floor(y)}`;
}

/**
 * What the values are.
 *
 * @param {Unit} unit
 */
export function unitWords(unit) {
  if (unit === "reflectance")
    return "Reflectance: 0 is as dark as the dark reference, 1 as bright as the white one.";
  return "Counts, not reflectance: the calibration has no white reference.";
}

/**
 * What a place's spectrum was measured from.
 *
 * @param {Measured} measured
 */
export function measuredWords({ spectrum: { cells, saturated } }) {
  const from = counted(cells, "cell");
  if (saturated === 0) return from;
  return `${from}, ${counted(saturated, "sample")} at full scale: the true values are higher`;
}

/**
 * Describes the plot for a screen reader.
 *
 * @param {Measured[]} measured
 * @param {Unit} unit
 */
export function plotWords(measured, unit) {
  if (measured.length === 0) return "A plot of spectra. No place is set.";
  const name = unit === "counts" ? "Counts" : "Reflectance";
  const places = measured.map(({ place }) => `${numberOf(place)} (${whereWords(place)})`);
  return `${name} over wavelength at place ${places.join(", ")}. The numbers follow as a table.`;
}

/**
 * A value as it is shown in the table of numbers.
 *
 * @param {number} value
 * @param {Unit} unit
 */
export function valueText(value, unit) {
  return value.toFixed(unit === "counts" ? 1 : 3);
}
