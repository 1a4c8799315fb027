import assert from "node:assert/strict";
import { test } from "node:test";

import { PARTS, summary } from "../static/tablet/words.js";

/** @param {string[]} failing */
const tried = (failing) =>
  /** @type {import("../static/tablet/words.js").Part[]} */ (Object.keys(PARTS)).map((part) => ({
    part,
    works: !failing.includes(part),
  }));

test("a tablet is unfit only without what no trial can do without", () => {
  assert.match(summary(tried([])), /Everything works/);
  assert.match(summary(tried(["microphone", "encrypted"])), /A trial can run/);
  assert.match(summary(tried(["microphone", "storage"])), /not fit/);
});
