// The plot's arithmetic: where a wavelength and a value are, its ticks, and the paths through a spectrum.

import { levelOf } from "./table.js";

/** @typedef {import("./table.js").Measured} Measured */
/** @typedef {import("./table.js").Unit} Unit */
/** @typedef {{ left: number, right: number, top: number, bottom: number }} Box */

/** A tick on either axis needs this many pixels. */
const TICK_WIDTH = 64;
const TICK_HEIGHT = 40;

/** Without spectra the plot spans these wavelengths, in nm. */
const WAVELENGTHS = [450, 650];

/** Converts wavelengths and values into pixels. */
export class PlotScale {
  /** Shortest and longest wavelength. @type {[number, number]} */
  #nm;
  /** Lowest and highest value. @type {[number, number]} */
  #values;
  #box;
  /** The wavelengths to write on the axis. */
  wavelengths;
  /** The values to write on the axis. */
  values;

  /**
   * @param {Measured[]} measured
   * @param {Unit} unit
   * @param {Box} box
   */
  constructor(measured, unit, box) {
    const bands = measured.flatMap(({ spectrum }) => spectrum.bands);
    const nm = bands.length > 0 ? bands.map((band) => band.wavelength_nm) : WAVELENGTHS;
    const levels = bands.map((band) => levelOf(band, unit));
    const most = Math.max(...levels.map(({ mean, spread }) => mean + spread), 0);
    const least = Math.min(...levels.map(({ mean, spread }) => mean - spread), 0);

    const across = Math.max(2, Math.floor((box.right - box.left) / TICK_WIDTH));
    const up = Math.max(2, Math.floor((box.bottom - box.top) / TICK_HEIGHT));
    this.#box = box;
    this.wavelengths = ticks(Math.min(...nm), Math.max(...nm), across);
    this.values = ticks(least, most > least ? most : least + 1, up);
    this.#nm = ends(this.wavelengths);
    this.#values = ends(this.values);
  }

  /** @param {number} nm */
  x(nm) {
    const [from, to] = this.#nm;
    return this.#box.left + ((nm - from) / (to - from)) * (this.#box.right - this.#box.left);
  }

  /** @param {number} value */
  y(value) {
    const [from, to] = this.#values;
    return this.#box.bottom - ((value - from) / (to - from)) * (this.#box.bottom - this.#box.top);
  }

  /**
   * The line through the means, as the `d` of an SVG path.
   *
   * @param {Api.PlaceSpectrum} spectrum
   * @param {Unit} unit
   */
  line(spectrum, unit) {
    return path(spectrum.bands.map((band) => [this.x(band.wavelength_nm), this.y(levelOf(band, unit).mean)]));
  }

  /**
   * The area a spread above and below the means, as the `d` of an SVG path.
   *
   * @param {Api.PlaceSpectrum} spectrum
   * @param {Unit} unit
   */
  area(spectrum, unit) {
    const edge = (/** @type {1 | -1} */ side) =>
      spectrum.bands.map((band) => {
        const { mean, spread } = levelOf(band, unit);
        return /** @type {[number, number]} */ ([this.x(band.wavelength_nm), this.y(mean + side * spread)]);
      });
    return `${path([...edge(1), ...edge(-1).reverse()])} z`;
  }
}

/** @param {[number, number][]} points */
function path(points) {
  return points.map(([x, y], index) => `${index ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join(" ");
}

/**
 * Round numbers, evenly spaced, from `least` or less to `most` or more; about `count` of them.
 *
 * @param {number} least
 * @param {number} most
 * @param {number} count
 */
export function ticks(least, most, count) {
  const rough = (most - least) / count || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * ([1, 2, 5].find((factor) => factor * power >= rough) ?? 10);
  const first = Math.floor(least / step + 1e-9);
  const last = Math.max(Math.ceil(most / step - 1e-9), first + 1);
  const digits = Math.max(0, -Math.floor(Math.log10(step)));
  return Array.from({ length: last - first + 1 }, (_, index) =>
    Number(((first + index) * step).toFixed(digits)),
  );
}

/**
 * @param {number[]} list at least two
 * @returns {[number, number]}
 */
function ends(list) {
  return [list[0] ?? 0, list.at(-1) ?? 1];
}
