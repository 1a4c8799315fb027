import assert from "node:assert/strict";
import { test } from "node:test";

import { Framing } from "../static/shared/framing.js";
import { Gestures } from "../static/shared/gestures.js";

const CELLS = { width: 512, height: 272 };
const REGION = { x: 156, y: 36, width: 200, height: 200 };
const UPRIGHT = { width: 800, height: 1000 };

/** The picture of a circle 200 cells wide, in a box. */
function framing(box = UPRIGHT, density = 2) {
  const made = new Framing();
  made.resize(box, density);
  made.show(CELLS, REGION);
  return made;
}

/**
 * The cell under a point of the box.
 *
 * @param {Framing} made
 * @param {number} x
 * @param {number} y
 */
function under(made, x, y) {
  const { left, top, scale } = made.place;
  return [(x - left) / scale, (y - top) / scale];
}

/**
 * @param {number[]} found
 * @param {number[]} expected
 */
function near(found, expected) {
  found.forEach((value, index) => {
    assert.ok(Math.abs(value - (expected[index] ?? Number.NaN)) < 1e-6, `${found} is not ${expected}`);
  });
}

test("the circle fills the box's shorter side, in its middle", () => {
  const made = framing();
  assert.equal(made.place.scale, 4);
  near(under(made, 400, 500), [256, 136]);
  near(under(made, 0, 500), [156, 136]);
  // 512 cells of 4 CSS pixels, 2 screen pixels each.
  assert.equal(made.screenWidth, 4096);
  assert.equal(framing({ width: 1000, height: 500 }, 1).place.scale, 2.5);
});

test("what is under the pointer stays there while one zooms", () => {
  const made = framing();
  const before = under(made, 300, 450);
  for (const factor of [1.3, 1.7, 0.8]) {
    made.zoomBy(factor, { x: 300, y: 450 });
    near(under(made, 300, 450), before);
  }
  assert.ok(Math.abs(made.zoom - 1.3 * 1.7 * 0.8) < 1e-9);
});

test("one can zoom in four times, or to a sample a screen pixel, and out to the fitted view", () => {
  const made = framing();
  made.zoomBy(100);
  assert.equal(made.zoom, 4);
  made.zoomBy(0.001);
  assert.equal(made.zoom, 1);

  // In a tiny box four times is less than one sample per pixel: 4 samples per cell, 2 screen pixels per CSS pixel.
  const tiny = framing({ width: 40, height: 40 }, 2);
  tiny.zoomBy(100);
  assert.equal(tiny.place.scale, 2);
});

test("dragging moves a zoomed picture, no further than it reaches, and a fitted one not at all", () => {
  const made = framing();
  const fitted = made.place;
  made.moveBy(50, 50);
  assert.deepEqual(made.place, fitted);

  made.zoomBy(2);
  const [x, y] = under(made, 400, 500);
  made.moveBy(80, -40);
  near(under(made, 400, 500), [(x ?? 0) - 10, (y ?? 0) + 5]);
  made.moveBy(1e6, 1e6);
  near(under(made, 0, 0), [0, 0]);
  made.moveBy(-1e6, -1e6);
  near(under(made, 800, 1000), [512, 272]);
});

test("nothing but a person moves a zoomed view", () => {
  const made = framing();
  made.zoomBy(3, { x: 100, y: 200 });
  const before = made.place;
  made.show(CELLS, { x: 170, y: 40, width: 190, height: 190 });
  assert.deepEqual(made.place, before);

  // A tablet that is turned shows the same place in the middle. When it is turned back, the view is as before.
  const middle = under(made, 400, 500);
  made.resize({ width: 1000, height: 800 }, 2);
  near(under(made, 500, 400), middle);
  made.resize(UPRIGHT, 2);
  assert.deepEqual(made.place, before);
});

test("a double tap zooms in on a place, and back", () => {
  const made = framing();
  const fitted = made.place;
  const before = under(made, 420, 480);
  made.toggle({ x: 420, y: 480 });
  assert.equal(made.zoom, 2.5);
  near(under(made, 420, 480), before);
  made.toggle({ x: 10, y: 10 });
  assert.deepEqual(made.place, fitted);
});

/** Gestures on a picture that notes each movement. */
function noting() {
  /** @type {string[]} */
  const notes = [];
  const round = (/** @type {number} */ value) => Math.round(value * 100) / 100;
  const gestures = new Gestures({
    zoomBy: (factor, { x, y }) => notes.push(`zoom ${round(factor)} at ${x},${y}`),
    moveBy: (dx, dy) => notes.push(`move ${round(dx)},${round(dy)}`),
    toggle: ({ x, y }) => notes.push(`toggle ${x},${y}`),
  });
  const tap = (/** @type {number} */ x, /** @type {number} */ y, /** @type {number} */ at) => {
    gestures.down(1, { x, y }, at);
    gestures.up(1, { x, y }, at + 80);
  };
  return { notes, gestures, tap };
}

test("two quick taps at one place are a double tap; slow ones, or ones apart, are not", () => {
  const { notes, tap } = noting();
  tap(100, 100, 0);
  tap(110, 95, 300);
  assert.deepEqual(notes, ["toggle 110,95"]);

  tap(100, 100, 2000);
  tap(100, 100, 3000);
  tap(300, 100, 3200);
  assert.deepEqual(notes, ["toggle 110,95"]);
  tap(305, 100, 3400);
  assert.deepEqual(notes, ["toggle 110,95", "toggle 305,100"]);
});

test("three quick taps are one double tap", () => {
  const { notes, tap } = noting();
  tap(100, 100, 0);
  tap(100, 100, 200);
  tap(100, 100, 400);
  assert.deepEqual(notes, ["toggle 100,100"]);
});

test("a finger that trembles taps, one that moves on drags", () => {
  const { notes, gestures } = noting();
  gestures.down(1, { x: 100, y: 100 }, 0);
  gestures.move(1, { x: 105, y: 100 });
  assert.deepEqual(notes, []);
  gestures.move(1, { x: 130, y: 100 });
  gestures.move(1, { x: 130, y: 90 });
  gestures.up(1, { x: 130, y: 90 }, 100);
  gestures.down(1, { x: 130, y: 90 }, 200);
  gestures.up(1, { x: 130, y: 90 }, 280);
  assert.deepEqual(notes, ["move 30,0", "move 0,-10"], "a drag and a tap are no double tap");
});

test("two fingers pinch around their middle, and neither is a tap", () => {
  const { notes, gestures } = noting();
  gestures.down(1, { x: 100, y: 100 }, 0);
  gestures.down(2, { x: 200, y: 100 }, 10);
  gestures.move(2, { x: 300, y: 100 });
  gestures.up(2, { x: 300, y: 100 }, 60);
  gestures.up(1, { x: 100, y: 100 }, 70);
  gestures.down(1, { x: 100, y: 100 }, 150);
  gestures.up(1, { x: 100, y: 100 }, 200);
  assert.deepEqual(notes, ["zoom 2 at 150,100", "move 50,0"]);
});

test("a pinch takes back the tap just before it, and none of long ago", () => {
  for (const [pause, isTakenBack] of /** @type {const} */ ([
    [200, true],
    [5000, false],
  ])) {
    let takenBack = 0;
    const gestures = new Gestures(new Framing(), {
      tap: () => {},
      takeBack: () => {
        takenBack += 1;
      },
    });
    gestures.down(1, { x: 50, y: 50 }, 0);
    gestures.up(1, { x: 50, y: 50 }, 40);
    gestures.down(1, { x: 50, y: 50 }, pause);
    gestures.down(2, { x: 90, y: 90 }, pause + 20);
    assert.equal(takenBack > 0, isTakenBack, `${pause} ms`);
  }
});

test("a pointer that the browser takes, or that never came down, does nothing", () => {
  const { notes, gestures } = noting();
  gestures.move(7, { x: 1, y: 1 });
  gestures.up(7, { x: 1, y: 1 }, 5);
  gestures.down(1, { x: 0, y: 0 }, 10);
  gestures.cancel(1);
  gestures.move(1, { x: 90, y: 0 });
  assert.deepEqual(notes, []);
});
