// The texts that tell the operator whether everything is ready.

import assert from "node:assert/strict";
import { test } from "node:test";

import { heading, passed, shown, sorted, summary } from "../static/operator/checks_words.js";

/**
 * @param {"well" | "advice" | "wrong"} verdict
 * @param {string} subject
 */
function finding(verdict, subject = "disk") {
  return { subject, verdict, found: "Found.", advice: verdict === "well" ? null : "Do this." };
}

test("what must be put right comes before what to look at", () => {
  const findings = [
    finding("well"),
    finding("advice", "clock"),
    finding("wrong", "lens"),
    finding("well", "network"),
  ];
  const { open, well } = sorted(findings);
  assert.deepEqual(
    open.map(({ subject }) => subject),
    ["lens", "clock"],
  );
  assert.deepEqual(
    well.map(({ subject }) => subject),
    ["disk", "network"],
  );
});

test("the summary says whether a trial can run", () => {
  assert.equal(summary([finding("well")]), "Everything is ready.");
  assert.equal(summary([finding("well"), finding("advice")]), "A trial can run. 1 thing to look at.");
  assert.equal(
    summary([finding("wrong"), finding("wrong"), finding("advice")]),
    "2 things to fix before a trial.",
  );
  assert.equal(passed(1), "1 check passed");
  assert.equal(passed(9), "9 checks passed");
});

test("a verdict has a mark, and words for those who cannot see it", () => {
  assert.equal(shown(finding("well")).mark, "✓");
  assert.equal(shown(finding("wrong")).words, "Put this right first");
  assert.equal(heading("camera's network"), "Camera's network");
});
