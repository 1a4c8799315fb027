import assert from "node:assert/strict";
import { test } from "node:test";

import { exceptDouble } from "../static/operator/double_click.js";

test("a double click on “Pause” does not press the “Resume” that takes its place", () => {
  /** @type {string[]} */
  const done = [];
  const pause = exceptDouble(() => done.push("pause"));
  const resume = exceptDouble(() => done.push("resume"));

  pause({ detail: 1 });
  resume({ detail: 2 });
  assert.deepEqual(done, ["pause"]);

  // A click after a while counts from one again; a key counts as none.
  resume({ detail: 1 });
  pause({ detail: 0 });
  assert.deepEqual(done, ["pause", "resume", "pause"]);
});
