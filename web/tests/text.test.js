// How times are written.

import assert from "node:assert/strict";
import { test } from "node:test";

import { secondText } from "../static/shared/text.js";

test("the hour after midnight is 00", () => {
  assert.equal(secondText(new Date(2026, 2, 1, 0, 5, 9).toISOString()), "00:05:09");
  assert.equal(secondText(new Date(2026, 2, 1, 14, 5, 9).toISOString()), "14:05:09");
});
