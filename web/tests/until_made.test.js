// Following what the server makes in the background, until the server no longer keeps it.

import assert from "node:assert/strict";
import { test } from "node:test";

const page = Object.assign(new EventTarget(), { hidden: false });
Object.assign(globalThis, { document: page });
const { followUntilMade } = await import("../static/shared/until_made.js");

test("a page that somebody comes back to no longer offers what the server has removed", async () => {
  let kept = { state: "ready" };
  /** @type {string[]} */
  const shown = [];
  const trouble = /** @type {HTMLElement} */ (/** @type {unknown} */ ({}));
  followUntilMade(
    async () => kept,
    ({ state }) => shown.push(state),
    trouble,
  );
  await answered();
  assert.deepEqual(shown, ["ready"]);

  kept = { state: "none" };
  page.hidden = true;
  page.dispatchEvent(new Event("visibilitychange"));
  await answered();
  assert.deepEqual(shown, ["ready"], "nobody looks");

  page.hidden = false;
  page.dispatchEvent(new Event("visibilitychange"));
  await answered();
  assert.deepEqual(shown, ["ready", "none"]);

  page.dispatchEvent(new Event("visibilitychange"));
  await answered();
  assert.equal(shown.length, 2, "nothing is left that could be removed");
});

/** Lets the server's answer reach the page. */
function answered() {
  return new Promise((resolve) => setImmediate(resolve));
}
