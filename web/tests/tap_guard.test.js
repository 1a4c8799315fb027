import assert from "node:assert/strict";
import { test } from "node:test";

import { TapGuard } from "../static/surgeon/tap_guard.js";

test("the second half of a double tap is no answer to what has just appeared", () => {
  const guard = new TapGuard();
  guard.shown(1000);
  assert.equal(guard.touch(1201), false);
  assert.equal(guard.click(1290, false), false);

  assert.equal(guard.touch(1599), false);
  assert.equal(guard.click(1700, false), false, "a finger that came too soon and left late");

  assert.equal(guard.touch(1700), true);
  assert.equal(guard.click(1750, false), true);
});

test("keys are guarded for as long, and nothing before anything has appeared", () => {
  const guard = new TapGuard();
  assert.equal(guard.click(100, true), true);
  guard.shown(1000);
  assert.equal(guard.click(1500, true), false);
  assert.equal(guard.click(1600, true), true);
});
