import assert from "node:assert/strict";
import { test } from "node:test";

import { exceptDouble } from "../static/operator/double_click.js";

test("further clicks on “Pause” do not press the “Resume” that takes its place", () => {
  /** @type {string[]} */
  const done = [];
  const pause = exceptDouble(() => done.push("pause"));
  const resume = exceptDouble(() => done.push("resume"));

  pause({ detail: 1, timeStamp: 1000 });
  resume({ detail: 2, timeStamp: 1200 });
  resume({ detail: 3, timeStamp: 1400 });
  assert.deepEqual(done, ["pause"]);

  // Of a finger's taps the fourth counts as the first again.
  resume({ detail: 1, timeStamp: 1600 });
  resume({ detail: 2, timeStamp: 1800 });
  assert.deepEqual(done, ["pause"]);

  // A click after a while counts from one again; a key counts as none.
  resume({ detail: 1, timeStamp: 3000 });
  pause({ detail: 0, timeStamp: 3100 });
  assert.deepEqual(done, ["pause", "resume", "pause"]);

  // Whoever resumes by mistake can pause at once, with a button that stands elsewhere.
  resume({ detail: 1, timeStamp: 3200 });
  pause({ detail: 1, timeStamp: 3400 });
  assert.deepEqual(done, ["pause", "resume", "pause", "resume", "pause"]);
});
