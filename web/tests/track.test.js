import assert from "node:assert/strict";
import { test } from "node:test";

import { valueAfter, valueAt } from "../static/surgeon/track.js";

const LINE = { min: 0, max: 100 };
const GRADED = { min: 1, max: 21 };

test("a touch marks the nearest value, and one beside the line its end", () => {
  assert.deepEqual(
    [-0.2, 0, 0.004, 0.006, 0.5, 1, 1.3].map((fraction) => valueAt(LINE, fraction)),
    [0, 0, 0, 1, 50, 100, 100],
  );
  assert.deepEqual(
    [0, 0.024, 0.026, 0.5, 1].map((fraction) => valueAt(GRADED, fraction)),
    [1, 1, 2, 11, 21],
  );
});

test("keys move the mark by one, and never beyond the ends", () => {
  assert.equal(valueAfter(LINE, 50, "ArrowRight"), 51);
  assert.equal(valueAfter(LINE, 50, "ArrowDown"), 49);
  assert.equal(valueAfter(LINE, 100, "ArrowUp"), 100);
  assert.equal(valueAfter(GRADED, 1, "ArrowLeft"), 1);
  assert.equal(valueAfter(LINE, 3, "PageDown"), 0);
  assert.deepEqual([valueAfter(GRADED, 5, "Home"), valueAfter(GRADED, 5, "End")], [1, 21]);
  assert.equal(valueAfter(LINE, 50, "a"), null);
});

test("a line without a mark begins in its middle, and only when a key asks for it", () => {
  assert.equal(valueAfter(LINE, null, "ArrowRight"), 50);
  assert.equal(valueAfter(LINE, null, "Tab"), null);
});
