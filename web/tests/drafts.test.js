import assert from "node:assert/strict";
import { test } from "node:test";

import { Drafts } from "../static/surgeon/drafts.js";
import { Origins } from "../static/surgeon/origin.js";
import { countedIds, FakeTime, fakeStore } from "./around.js";

/** Two tabs of one device. */
function twoTabs() {
  const store = fakeStore();
  const newId = countedIds();
  const origins = new Origins(store, new FakeTime(), newId);
  const tab = (/** @type {string} */ name) => new Drafts(store, origins, newId, name);
  return { store, first: tab("first"), second: tab("second") };
}

test("a draft is found again after a reload, under the key that it will be sent with", () => {
  const { first } = twoTabs();
  first.open("comment.s").write({ text: "Half" });
  first.open("comment.s").write({ text: "Half a thought" });

  const again = first.open("comment.s");
  assert.deepEqual(again.read(), { text: "Half a thought" });
  const key = first.of("comment.")[0]?.key;
  assert.equal(again.take().key, key);
  assert.equal(again.read(), null);
  assert.deepEqual(first.of("comment."), []);
});

test("a draft is in one tab until the other takes it over, with its key", () => {
  const { first, second } = twoTabs();
  const here = first.open("comment.s");
  here.write({ text: "Half" });
  const there = second.open("comment.s");
  assert.equal(there.read(), null);

  const [offered] = there.elsewhere();
  assert.ok(offered);
  assert.equal(here.claimed, false);
  there.claim(offered);
  assert.deepEqual(there.read(), { text: "Half" });
  assert.equal(here.claimed, true, "the first tab knows that it must not send it");
  assert.deepEqual(there.elsewhere(), []);
  assert.equal(there.take().key, offered.key);
});

test("drafts are distinguished by their whole names", () => {
  const { first } = twoTabs();
  first.open("answer.s/1/remarks").write("a");
  first.open("answer.s/1/remarks-too").write("b");
  assert.equal(first.open("answer.s/1/remarks").read(), "a");
  assert.deepEqual(
    first
      .of("answer.s/1/")
      .map(({ rest }) => rest)
      .sort(),
    ["remarks", "remarks-too"],
  );
});

test("a device that stores nothing keeps a draft for as long as the page stands", () => {
  const { store, first } = twoTabs();
  store.full = true;
  const draft = first.open("comment.s");
  draft.write({ text: "Half" });
  assert.deepEqual(draft.read(), { text: "Half" });
  assert.deepEqual(first.of("comment."), []);
});
