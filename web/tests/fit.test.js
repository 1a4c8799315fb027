import assert from "node:assert/strict";
import { test } from "node:test";

import { Fit } from "../static/shared/fit.js";

const CELLS = { width: 512, height: 272 };
const CIRCLE = { x: 256, y: 136, radius: 100 };
/** The circle's box, 3 % of its radius wider on each side. */
const AROUND = { x: 153, y: 33, width: 206, height: 206 };
const WHOLE = { x: 0, y: 0, width: 512, height: 272 };

const jumping = () => new Fit({ glides: false });

/**
 * The part shown after each of `count` pictures, 20 ms apart.
 *
 * @param {Fit} fit
 * @param {(index: number) => Stream.Circle | null} circle
 * @param {number} from
 * @param {number} count
 */
function watch(fit, circle, from, count) {
  return Array.from({ length: count }, (_, index) => fit.see(CELLS, circle(index), from + 20 * index));
}

test("the first picture is fitted to its circle at once", () => {
  assert.deepEqual(jumping().see(CELLS, CIRCLE, 0), AROUND);
  assert.deepEqual(new Fit({ glides: true }).see(CELLS, CIRCLE, 0), AROUND);
});

test("without a circle all of the picture is shown, and of a circle only what is on the picture", () => {
  assert.deepEqual(jumping().see(CELLS, null, 0), WHOLE);
  const large = { x: 250, y: 136, radius: 200 };
  assert.deepEqual(jumping().see(CELLS, large, 0), { x: 44, y: 0, width: 412, height: 272 });
  const elsewhere = { x: 5000, y: 136, radius: 100 };
  assert.deepEqual(jumping().see(CELLS, elsewhere, 0), WHOLE);
});

test("a circle that trembles, is lost or is misplaced for a while moves nothing", () => {
  const fit = jumping();
  fit.see(CELLS, CIRCLE, 0);
  const trembling = watch(fit, (index) => ({ ...CIRCLE, x: 256 + 7 * (-1) ** index, radius: 95 }), 20, 500);
  const lost = watch(fit, () => null, 20_000, 500);
  const misplaced = watch(fit, () => ({ ...CIRCLE, radius: 60 }), 40_000, 50);
  const back = watch(fit, () => CIRCLE, 41_000, 100);
  for (const region of [...trembling, ...lost, ...misplaced, ...back]) assert.deepEqual(region, AROUND);
});

test("a circle that wanders without agreeing with itself moves nothing", () => {
  const fit = jumping();
  fit.see(CELLS, CIRCLE, 0);
  for (const region of watch(fit, (index) => ({ ...CIRCLE, x: 300 + 20 * (index % 2) }), 20, 500)) {
    assert.deepEqual(region, AROUND);
  }
});

test("a circle that stays elsewhere for a second is followed", () => {
  const fit = jumping();
  fit.see(CELLS, CIRCLE, 0);
  const moved = { x: 276, y: 126, radius: 100 };
  const regions = watch(fit, () => moved, 20, 60);
  assert.deepEqual(regions[49], AROUND);
  assert.deepEqual(regions[50], { x: 173, y: 23, width: 206, height: 206 });
});

test("the view glides to another place, and arrives", () => {
  const fit = new Fit({ glides: true });
  fit.see(CELLS, CIRCLE, 0);
  const lefts = watch(fit, () => ({ ...CIRCLE, x: 296 }), 20, 150).map(({ x }) => x);
  const steps = lefts.map((x, index) => x - (lefts[index - 1] ?? 153));
  assert.ok(Math.max(...steps) < 6, "no step of the 40 cells is a jump");
  assert.ok(Math.min(...steps) >= 0);
  assert.equal(lefts.at(-1), 193);
});

test("pictures of another camera are fitted anew", () => {
  const fit = jumping();
  fit.see(CELLS, CIRCLE, 0);
  const other = { width: 640, height: 480 };
  assert.deepEqual(fit.see(other, null, 20), { x: 0, y: 0, width: 640, height: 480 });
});
