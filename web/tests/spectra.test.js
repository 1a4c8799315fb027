// Spectra: the places and their colours, how often the server is asked, the plot's arithmetic, and the table.

import assert from "node:assert/strict";
import { test } from "node:test";

import { Asking } from "../static/spectra/asking.js";
import { Cross } from "../static/spectra/cross.js";
import { LOOKS } from "../static/spectra/looks.js";
import { Places } from "../static/spectra/places.js";
import { PlotScale, ticks } from "../static/spectra/scale.js";
import { csv, unitOf } from "../static/spectra/table.js";
import { measuredWords, plotWords, unitWords } from "../static/spectra/words.js";

/**
 * A spectrum of two bands.
 *
 * @param {number | null} reflectance
 * @returns {Api.PlaceSpectrum}
 */
const spectrum = (reflectance) => ({
  cells: 81,
  saturated: 0,
  bands: [460, 600].map((nm, index) => ({
    wavelength_nm: nm,
    fwhm_nm: 10,
    counts: 100 + 50 * index,
    counts_spread: 8,
    reflectance,
    reflectance_spread: reflectance === null ? null : 0.02,
  })),
});

const PLACE = { look: 1, x: 10.5, y: 20 };

test("up to five places, each with the first look that is free", () => {
  const places = new Places();
  for (const x of [1, 2, 3, 4, 5]) places.add({ x, y: 7.19 });
  assert.deepEqual(
    places.all.map(({ look, x, y }) => [look, x, y]),
    [1, 2, 3, 4, 5].map((x) => [x - 1, x, 7.1]),
  );
  assert.equal(places.all.length, 5);
  assert.equal(places.add({ x: 6, y: 7 }), null);

  const second = places.all[1];
  assert.ok(second);
  places.remove(second);
  const sixth = places.add({ x: 6, y: 7 });
  assert.equal(sixth?.look, 1);
  assert.deepEqual(
    places.all.map(({ x }) => x),
    [1, 6, 3, 4, 5],
  );
  places.clear();
  assert.deepEqual(places.all, []);
});

test("the keyboard's cross begins in the middle and stays in the picture", () => {
  const cross = new Cross();
  const cells = { width: 512, height: 272 };
  cross.move(2, -3, cells);
  assert.deepEqual(cross.at, { x: 258, y: 133 });
  cross.move(-9999, 9999, cells);
  assert.deepEqual(cross.at, { x: 0, y: 271.9 });
});

/** Matrices from linear RGB to what people see who lack a kind of cone: Machado et al. 2009, severity 1. */
const SEEN = {
  protanopia: [0.152286, 1.052583, -0.204868, 0.114503, 0.786281, 0.099216, -0.003882, -0.048116, 1.051998],
  deuteranopia: [0.367322, 0.860646, -0.227968, 0.280085, 0.672501, 0.047413, -0.01182, 0.04294, 0.968881],
  tritanopia: [1.255528, -0.076749, -0.178779, -0.078411, 0.930809, 0.147602, 0.004733, 0.691367, 0.3039],
  all: [1, 0, 0, 0, 1, 0, 0, 0, 1],
};

/**
 * CIE Lab of a colour as it is seen through `matrix`.
 *
 * @param {string} colour
 * @param {number[]} matrix
 */
function lab(colour, matrix) {
  const linear = [1, 3, 5].map((at) => {
    const value = Number.parseInt(colour.slice(at, at + 2), 16) / 255;
    return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
  });
  const times = (/** @type {number[]} */ m, /** @type {number[]} */ v) =>
    [0, 3, 6].map((row) => [0, 1, 2].reduce((sum, i) => sum + (m[row + i] ?? 0) * (v[i] ?? 0), 0));
  const seen = times(matrix, linear).map((value) => Math.min(Math.max(value, 0), 1));
  const xyz = times([0.4124, 0.3576, 0.1805, 0.2126, 0.7152, 0.0722, 0.0193, 0.1192, 0.9505], seen);
  const [x = 0, y = 0, z = 0] = xyz.map((value, i) => {
    const share = value / ([0.9505, 1, 1.089][i] ?? 1);
    return share > 0.008856 ? Math.cbrt(share) : 7.787 * share + 16 / 116;
  });
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}

test("people who lack a kind of cone tell the colours apart, on the page and on paper", () => {
  for (const [who, matrix] of Object.entries(SEEN)) {
    for (const paper of /** @type {const} */ (["dark", "light"])) {
      const seen = LOOKS.map((look) => lab(look[paper], matrix));
      for (const [index, one] of seen.entries()) {
        for (const other of seen.slice(index + 1)) {
          const apart = Math.hypot(...one.map((value, i) => value - (other[i] ?? 0)));
          assert.ok(apart > 15, `${who}, ${paper}: colour ${index + 1} is ${apart.toFixed(1)} from another`);
        }
      }
    }
  }
  assert.equal(new Set(LOOKS.map(({ mark }) => mark)).size, LOOKS.length, "and everybody by the marks");
});

test("one request at a time; what is wanted sooner is asked sooner", async () => {
  let now = 0;
  /** @type {{ at: number, run: () => void }[]} */
  let timers = [];
  /** @type {number[]} */
  const asked = [];
  let answer = () => {};
  /** @type {import("../static/spectra/asking.js").Time} */
  const time = {
    later: (run, ms) => {
      const timer = { at: now + ms, run };
      timers.push(timer);
      return () => {
        timers = timers.filter((other) => other !== timer);
      };
    },
    now: () => now,
  };
  const asking = new Asking(() => {
    asked.push(now);
    return new Promise((done) => {
      answer = () => done();
    });
  }, time);
  const pass = (/** @type {number} */ ms) => {
    now += ms;
    const due = timers.filter(({ at }) => at <= now);
    timers = timers.filter(({ at }) => at > now);
    for (const { run } of due) run();
  };
  const answered = async () => {
    answer();
    await new Promise((done) => setImmediate(done));
  };

  asking.want(200);
  asking.want(500);
  pass(199);
  assert.deepEqual(asked, []);
  asking.want();
  assert.deepEqual(asked, [199]);

  // While a request is under way nothing is asked, however often it is wanted; after it, once.
  asking.want();
  asking.want();
  pass(100);
  assert.deepEqual(asked, [199]);
  await answered();
  assert.deepEqual(asked, [199, 299]);

  asking.want(50);
  asking.stop();
  await answered();
  pass(1000);
  assert.deepEqual(asked, [199, 299]);
});

test("ticks are round numbers that hold all values", () => {
  assert.deepEqual(ticks(0, 0.87, 5), [0, 0.2, 0.4, 0.6, 0.8, 1]);
  assert.deepEqual(ticks(460.1, 598.7, 6), [450, 500, 550, 600]);
  assert.deepEqual(ticks(-0.03, 0.3, 4), [-0.1, 0, 0.1, 0.2, 0.3]);
  assert.deepEqual(ticks(0, 1023, 5), [0, 500, 1000, 1500]);
});

test("a spectrum's line goes through its means, and its area spans the spread", () => {
  const measured = [{ place: PLACE, radius: 8, spectrum: spectrum(0.5) }];
  // 450 to 600 nm over 150 pixels; 0 to 0.6 over 60.
  const scale = new PlotScale(measured, "reflectance", { left: 0, right: 150, top: 0, bottom: 60 });
  assert.deepEqual(scale.wavelengths, [400, 500, 600]);
  assert.equal(scale.line(spectrum(0.5), "reflectance").split(" ")[0], "M45.0");
  assert.equal(scale.y(0), 60);
  assert.equal(scale.area(spectrum(0.5), "reflectance").match(/[ML]/g)?.length, 4);

  const empty = new PlotScale([], "counts", { left: 0, right: 150, top: 0, bottom: 60 });
  assert.ok(empty.wavelengths.length > 1 && empty.values.length > 1, "axes also without a spectrum");
});

test("the table has the command's columns after place and frame", () => {
  const table = csv([{ place: PLACE, radius: 8, spectrum: spectrum(null) }], 12);
  assert.deepEqual(table.split("\n"), [
    "place,frame,x,y,radius,cells,saturated,wavelength_nm,fwhm_nm,counts,counts_spread,reflectance,reflectance_spread",
    "2,12,10.5,20,8,81,0,460,10,100,8,,",
    "2,12,10.5,20,8,81,0,600,10,150,8,,",
    "",
  ]);
});

test("counts are shown where there is no reflectance, and said to be counts", () => {
  const of = (/** @type {number | null} */ reflectance) => [
    { place: PLACE, radius: 8, spectrum: spectrum(reflectance) },
  ];
  assert.deepEqual([unitOf(of(0.5)), unitOf(of(null)), unitOf([])], ["reflectance", "counts", "reflectance"]);
  assert.match(unitWords("counts"), /no white reference/);
  assert.equal(
    plotWords(of(null), "counts"),
    "Counts over wavelength at place 2 (x 10, y 20). The numbers follow as a table.",
  );
  const [one] = of(0.5);
  assert.ok(one);
  assert.equal(measuredWords(one), "81 cells");
  one.spectrum.saturated = 1;
  assert.equal(measuredWords(one), "81 cells, 1 sample at full scale: the true values are higher");
});
