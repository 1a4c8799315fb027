// The texts about an export on the study's page.

import assert from "node:assert/strict";
import { test } from "node:test";

import {
  failedWords,
  progressShare,
  progressWords,
  readyWords,
} from "../static/researcher/study_export_words.js";

/**
 * @param {Partial<Api.StudyExportProgress>} progress
 * @param {boolean} [unblinded]
 */
function running(progress, unblinded = false) {
  const whole = { sessions: 0, exported: 0, steps: 0, joined: 0, ...progress };
  return /** @type {const} */ ({ state: "running", unblinded, progress: whole });
}

test("while it is made, the sessions done and then the steps of joining are told", () => {
  assert.equal(progressWords(running({})), "The export without policies begins.");
  const sessions = running({ sessions: 100, exported: 42 }, true);
  assert.equal(progressWords(sessions), "Exporting with policies: 42 of 100 sessions.");
  const joining = running({ sessions: 1, exported: 1, steps: 27, joined: 3 });
  assert.equal(
    progressWords(joining),
    "Exporting without policies: 1 session done. Joining them: step 3 of 27.",
  );
});

test("the bar never goes back", () => {
  const course = [
    running({}),
    running({ sessions: 4 }),
    running({ sessions: 4, exported: 2 }),
    running({ sessions: 4, exported: 4 }),
    running({ sessions: 4, exported: 4, steps: 20 }),
    running({ sessions: 4, exported: 4, steps: 20, joined: 19 }),
    running({ sessions: 4, exported: 4, steps: 20, joined: 20 }),
  ];
  const shares = course.map(({ progress }) => progressShare(progress));
  assert.deepEqual(
    shares,
    [...shares].sort((one, other) => one - other),
  );
  assert.equal(shares[0], 0);
  assert.ok(Math.abs((shares.at(-1) ?? 0) - 1) < 1e-9);
});

test("the end is told, whole or failed", () => {
  const ready = /** @type {const} */ ({ state: "ready", unblinded: true, sessions: 100 });
  assert.equal(
    readyWords(ready),
    "The export with policies is ready: 100 sessions. The server keeps it for an hour.",
  );
  const failed = /** @type {const} */ ({ state: "failed", unblinded: false, reason: "the disk is full" });
  assert.equal(failedWords(failed), "The export without policies failed: the disk is full");
});
