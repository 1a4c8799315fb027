// Measured spectra as numbers: their unit, and the table that can be copied.

/** @typedef {import("./places.js").Place} Place */

/**
 * The spectrum at a place.
 *
 * @typedef {object} Measured
 * @property {Place} place
 * @property {number} radius samples
 * @property {Api.PlaceSpectrum} spectrum
 */

/** @typedef {"reflectance" | "counts"} Unit */

/** The columns of the table after those that name place and frame, as `parfocal recording spectrum` has them. */
const COLUMNS = /** @type {const} */ ([
  "wavelength_nm",
  "fwhm_nm",
  "counts",
  "counts_spread",
  "reflectance",
  "reflectance_spread",
]);

/**
 * Counts, unless every spectrum has reflectance.
 *
 * @param {Measured[]} measured
 * @returns {Unit}
 */
export function unitOf(measured) {
  const known = measured.every(({ spectrum }) => spectrum.bands.every((band) => band.reflectance != null));
  return known ? "reflectance" : "counts";
}

/**
 * Mean and spread of a band.
 *
 * @param {Api.BandLevel} band
 * @param {Unit} unit
 */
export function levelOf(band, unit) {
  if (unit === "counts") return { mean: band.counts, spread: band.counts_spread };
  return { mean: band.reflectance ?? 0, spread: band.reflectance_spread ?? 0 };
}

/**
 * The table with a row for each place and band.
 *
 * @param {Measured[]} measured
 * @param {number} frame
 */
export function csv(measured, frame) {
  const head = ["place", "frame", "x", "y", "radius", "cells", "saturated", ...COLUMNS];
  const rows = measured.flatMap(({ place, radius, spectrum }) =>
    spectrum.bands.map((band) => [
      place.look + 1,
      frame,
      place.x,
      place.y,
      radius,
      spectrum.cells,
      spectrum.saturated,
      ...COLUMNS.map((column) => band[column] ?? ""),
    ]),
  );
  return `${[head, ...rows].map((row) => row.join(",")).join("\n")}\n`;
}
