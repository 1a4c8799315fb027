import assert from "node:assert/strict";
import { test } from "node:test";

import { Refused } from "../static/shared/api.js";
import { settle } from "./around.js";
import { outboxPage } from "./outbox_page.js";

const fullDisk = () => new Refused(507, "the disk is full", true);
const noNetwork = () => new TypeError("Failed to fetch");

/** @typedef {ReturnType<typeof outboxPage>} Page */

/** @param {Page["server"]} server */
const texts = (server) => server.got.map(({ body }) => body.text);

/** @param {Page["store"]} store */
const keptEntries = (store) => store.names("parfocal.outbox.").length;

test("what the server has saved is taken off the device", async () => {
  const page = outboxPage();
  const outbox = page.open();
  outbox.add("/comments", { session: "s", text: "a" });
  assert.equal(keptEntries(page.store), 1, "it is on the device before it is sent");

  await settle();
  assert.deepEqual(texts(page.server), ["a"]);
  assert.equal(keptEntries(page.store), 0);
  assert.deepEqual(outbox.waiting, []);
});

test("without a network the waits double up to eight seconds, and a nudge tries at once", async () => {
  const page = outboxPage();
  const outbox = page.open();
  page.server.answers = Array.from({ length: 8 }, noNetwork);
  outbox.add("/comments", { session: "s", text: "a" });
  await settle();

  const waits = [];
  for (let attempt = 1; attempt <= 6; attempt++) {
    const wait = page.time.nextIn ?? 0;
    waits.push(wait);
    await page.time.pass(wait);
  }
  assert.deepEqual(waits, [500, 1000, 2000, 4000, 8000, 8000]);
  assert.equal(outbox.trouble, "No connection. This page keeps trying.");

  outbox.nudge();
  await settle();
  assert.equal(page.server.got.length, 8);
  assert.equal(page.time.nextIn, 500, "and waits as after a first attempt");

  await page.time.pass(500);
  assert.equal(outbox.trouble, null);
  assert.equal(new Set(page.server.got.map(({ body }) => body.key)).size, 1, "always under the same key");
});

test("what is not answered for two seconds is told as kept here, and its request goes on", async () => {
  const page = outboxPage();
  const outbox = page.open();
  /** @type {(answer: Error | null) => void} */
  let answer = () => {};
  const hangs = () =>
    new Promise((/** @type {(answer: Error | null) => void} */ resolve) => (answer = resolve));
  page.server.answers = [hangs(), null];
  /** @type {string[]} */
  const told = [];
  outbox.subscribe(({ entry, state }) => told.push(`${entry.body.text} ${state}`));
  outbox.add("/comments", { session: "s", text: "a" });
  const settled = outbox.settled("/comments");

  await page.time.pass(1999);
  assert.deepEqual([told, outbox.trouble], [["a saving"], null]);
  await page.time.pass(1);
  assert.deepEqual(told, ["a saving", "a late"]);
  assert.equal(outbox.trouble, "No answer yet. This page keeps trying.");
  outbox.add("/comments", { session: "s", text: "b" });
  outbox.nudge();
  await settle();
  assert.equal(page.server.got.length, 1, "it is not sent twice");

  answer(null);
  await settle();
  assert.deepEqual(told.slice(2), ["b saving", "a saved", "b saved"]);
  assert.deepEqual([outbox.trouble, page.time.nextIn], [null, null]);
  assert.equal(await settled, true, "whoever waits for it waits on");
});

test("a reload sends what was left, in the order of entry", async () => {
  const page = outboxPage();
  const first = page.open();
  page.server.answers = [noNetwork(), noNetwork(), noNetwork()];
  first.add("/comments", { session: "s", text: "one" });
  page.time.wallMillis -= 60_000;
  first.add("/comments", { session: "s", text: "two" });
  await settle();
  assert.equal(keptEntries(page.store), 2);

  const later = outboxPage(page.store, page.time, page.newId);
  later.open();
  await settle();
  assert.deepEqual(texts(later.server), ["one", "two"], "also with a clock that was set back between them");
  assert.equal(keptEntries(page.store), 0);
});

test("what a tablet forgot when it lost its power is sent from the spare copy, in order", async () => {
  const page = outboxPage();
  const first = page.open();
  page.server.answers = [noNetwork(), noNetwork(), noNetwork()];
  first.add("/comments", { session: "s", text: "one" });
  first.add("/comments", { session: "s", text: "two" });
  await settle();

  // Only what was said some seconds earlier had reached the disk.
  const forgotten = page.store.names("parfocal.outbox.").sort().at(-1) ?? "";
  page.store.kept.delete(forgotten);
  const later = outboxPage(page.store, page.time, page.newId, page.spare);
  later.server.answers = [noNetwork()];
  const outbox = later.open();
  await outbox.ready;
  await settle();
  assert.equal(outbox.waiting.length, 2);
  assert.equal(outbox.held("s"), 2);
  assert.equal(keptEntries(page.store), 2, "another tab sees it again");

  outbox.nudge();
  await settle();
  assert.deepEqual(texts(later.server).slice(-2), ["one", "two"]);
  assert.equal(keptEntries(page.store), 0);
  assert.equal(page.spare.kept.size, 0, "what is saved is taken off both copies");
});

test("a spare copy that cannot be read at first is read again", async () => {
  const page = outboxPage();
  page.server.answers = [noNetwork()];
  page.open().add("/comments", { session: "s", text: "one" });
  await settle();
  page.store.kept.clear();
  page.spare.unreadable = true;
  const later = outboxPage(page.store, page.time, page.newId, page.spare);
  const outbox = later.open();
  await outbox.ready;
  assert.equal(outbox.waiting.length, 0);

  page.spare.unreadable = false;
  await page.time.pass(2000);
  await settle();
  assert.deepEqual(texts(later.server), ["one"]);
});

test("what this page or another tab has in hand is not taken from the spare copy", async () => {
  const page = outboxPage();
  page.server.answers = Array.from({ length: 9 }, noNetwork);
  const first = page.open();
  first.add("/comments", { session: "s", text: "one" });
  await settle();

  const other = page.open();
  first.add("/comments", { session: "s", text: "two" });
  await other.ready;
  await settle();
  assert.equal(other.waiting.length, 1, "the first tab sends what was said in it since");
});

test("after a loss of power no number is given twice, so that the last answer is the last", () => {
  const page = outboxPage();
  page.origins.stamp();
  const kept = new Map(page.store.kept);
  const said = [page.origins.stamp(), page.origins.stamp()].map(({ sequence }) => sequence ?? 0);

  page.store.kept.clear();
  for (const [name, text] of kept) page.store.kept.set(name, text);
  const next = outboxPage(page.store, page.time, page.newId).origins.stamp().sequence ?? 0;
  assert.ok(next > Math.max(...said), `${next} after ${said}`);
});

test("what one entry meets does not stop the others, unless nobody answers", async () => {
  const page = outboxPage();
  const outbox = page.open();
  page.server.answers = [noNetwork(), noNetwork()];
  outbox.add("/comments", { session: "s", text: "one" });
  outbox.add("/comments", { session: "s", text: "two" });
  await settle();
  assert.ok(!texts(page.server).includes("two"), "without a network the second is not worth trying");

  page.server.got = [];
  page.server.answers = [fullDisk(), null];
  outbox.nudge();
  await settle();
  assert.deepEqual(texts(page.server), ["one", "two"]);
  assert.deepEqual(
    outbox.waiting.map(({ body }) => body.text),
    ["one"],
  );
});

test("what the server refuses stays on the device, is counted, and is tried by the next page", async () => {
  const page = outboxPage();
  const outbox = page.open();
  page.server.answers = [new Refused(404, "no such session", true)];
  outbox.add("/comments", { session: "s", text: "a" });
  await settle();
  assert.equal(outbox.refused("s").length, 1);
  assert.equal(outbox.refused("t").length, 0);
  assert.equal(outbox.held("s"), 1, "once, though it is in memory and in storage");
  assert.deepEqual([...outbox.sessions], ["s"]);
  assert.equal(page.time.nextIn, null, "the same page does not try again");

  const later = outboxPage(page.store, page.time, page.newId);
  later.open();
  await settle();
  assert.deepEqual(texts(later.server), ["a"]);
  assert.equal(keptEntries(page.store), 0);
});

test("a proxy's refusal is not the server's, and is tried again", async () => {
  const page = outboxPage();
  const outbox = page.open();
  page.server.answers = [new Refused(404, "Not found", false)];
  outbox.add("/comments", { session: "s", text: "a" });
  await settle();
  assert.equal(outbox.refused("s").length, 0);

  await page.time.pass(500);
  assert.deepEqual(texts(page.server), ["a", "a"]);
  assert.deepEqual(outbox.waiting, []);
});

test("a new answer to a question replaces the one that was refused", async () => {
  const page = outboxPage();
  const outbox = page.open();
  page.server.answers = [new Refused(422, "not on the scale", true)];
  outbox.add("/answers", { session: "s", value: 9 }, "s/1/sharpness");
  await settle();
  assert.equal(outbox.refused("s").length, 1);
  const kept = outbox.refusedFor("s/1/sharpness").map(({ body, refusal }) => [body.value, refusal]);
  assert.deepEqual(kept, [[9, "not on the scale"]], "the page can show it again, and why it was refused");
  assert.deepEqual(outbox.refusedFor("s/1/sharp"), []);

  outbox.add("/answers", { session: "s", value: 5 }, "s/1/sharpness");
  await settle();
  assert.equal(outbox.refused("s").length, 0);
  assert.equal(keptEntries(page.store), 0);
});

test("entries for a question are found with those for its parts, and not with its namesakes'", async () => {
  const page = outboxPage();
  const outbox = page.open();
  page.server.answers = Array.from({ length: 4 }, noNetwork);
  outbox.add("/answers", { value: [1, 0] }, "s/1/sus/0");
  outbox.add("/answers", { value: 2 }, "s/1/sus");
  outbox.add("/answers", { value: 3 }, "s/1/sus2");
  await settle();
  assert.deepEqual(
    outbox.pending("s/1/sus").map(({ slot }) => slot),
    ["s/1/sus/0", "s/1/sus"],
  );
});

test("a draft that another tab has sent under the same key goes again under a new one", async () => {
  const page = outboxPage();
  const outbox = page.open();
  page.server.answers = [new Refused(409, "another text has this key", true)];
  outbox.add("/comments", { session: "s", text: "longer" }, null, { key: "draft-key" });
  await settle();
  const keys = page.server.got.map(({ body }) => body.key);
  assert.equal(keys.length, 2);
  assert.equal(keys[0], "draft-key");
  assert.notEqual(keys[1], "draft-key");
  assert.deepEqual(outbox.waiting, []);
});

test("waiting for answers ends at once if one fails or the server does not answer", async () => {
  const page = outboxPage();
  const outbox = page.open();
  page.server.answers = [noNetwork()];
  outbox.add("/comments", { session: "s", text: "c" });
  outbox.add("/answers", { session: "s", value: 4 }, "q");
  assert.equal(await outbox.settled("/answers"), false);

  assert.equal(await outbox.settled("/answers"), true);
  assert.deepEqual(outbox.waiting, []);
});

test("what a closed tab has left is sent by an open one", async () => {
  const page = outboxPage();
  const open = page.open();
  const other = outboxPage(page.store, page.time, page.newId);
  other.server.answers = Array.from({ length: 9 }, noNetwork);
  other.open().add("/comments", { session: "s", text: "from the closed tab" });
  await settle();

  open.wake();
  assert.equal(open.waiting.length, 1);
  await settle();
  assert.deepEqual(texts(page.server), ["from the closed tab"]);
  assert.equal(keptEntries(page.store), 0);
  open.wake();
  await settle();
  assert.equal(page.server.got.length, 1, "once");
});

test("a failing comment alone does not keep answers from being settled", async () => {
  const page = outboxPage();
  const outbox = page.open();
  page.server.answers = [fullDisk(), null];
  outbox.add("/comments", { session: "s", text: "c" });
  outbox.add("/answers", { session: "s", value: 4 }, "q");
  assert.equal(await outbox.settled("/answers"), true);
});

test("a device that stores nothing is reported as not durable, and still sends", async () => {
  const page = outboxPage();
  page.store.full = true;
  const outbox = page.open();
  page.server.answers = [noNetwork()];
  outbox.add("/comments", { session: "s", text: "a" });
  assert.equal(outbox.durable, false);
  await settle();
  await page.time.pass(500);
  assert.deepEqual(texts(page.server), ["a", "a"]);
  assert.equal(outbox.durable, true, "nothing is left that could be lost");
});

test("an entry that another tab has sent is no longer waiting here", async () => {
  const page = outboxPage();
  const outbox = page.open();
  page.server.answers = [noNetwork()];
  const { id } = outbox.add("/comments", { session: "s", text: "a" });
  await settle();

  /** @type {string[]} */
  const heard = [];
  outbox.subscribe(({ state }) => heard.push(state));
  outbox.doneElsewhere("parfocal.draft.comment");
  assert.deepEqual(heard, []);
  outbox.doneElsewhere(`parfocal.outbox.${id}`);
  assert.deepEqual(heard, ["saved"]);
  assert.deepEqual(outbox.waiting, []);
});

test("an entry that was refused here and that another tab has sent is no longer held here", async () => {
  const page = outboxPage();
  const outbox = page.open();
  page.server.answers = [new Refused(404, "no such session", true)];
  const { id } = outbox.add("/comments", { session: "s", text: "a" });
  await settle();
  const other = outboxPage(page.store, page.time, page.newId);
  other.open();
  await settle();
  assert.deepEqual(texts(other.server), ["a"]);

  outbox.doneElsewhere(`parfocal.outbox.${id}`);
  assert.deepEqual([outbox.refused("s"), outbox.held("s")], [[], 0]);
});

test("each entry has its number among all of the device, and its age", async () => {
  const page = outboxPage();
  const outbox = page.open();
  page.server.answers = [noNetwork(), noNetwork()];
  outbox.add("/comments", { session: "s", text: "one" });
  await page.time.pass(200);
  // Somebody sets the wall clock. The wait is not measured by it.
  page.time.wallMillis += 3_600_000;
  outbox.add("/comments", { session: "s", text: "two" });
  await settle();
  page.server.got = [];
  await page.time.pass(800);

  const told = page.server.got.map(({ body }) => ({
    text: body.text,
    sequence: body.sequence,
    waited: body.waited_millis,
    by: body.waited_by,
  }));
  assert.deepEqual(told, [
    { text: "one", sequence: 1, waited: 1000, by: "page-clock" },
    { text: "two", sequence: 2, waited: 800, by: "page-clock" },
  ]);
  assert.equal(new Set(page.server.got.map(({ body }) => body.device)).size, 1);
});

test("a wait over a reload, or with a sleep in it, is measured by the wall clock", async () => {
  const page = outboxPage();
  page.server.answers = [noNetwork()];
  page.open().add("/comments", { session: "s", text: "kept" });
  await settle();
  page.time.wallMillis += 600_000;

  const reloaded = outboxPage(page.store, page.time, page.newId);
  reloaded.open();
  await settle();
  assert.equal(reloaded.server.got[0]?.body.waited_millis, 600_000);
  assert.equal(reloaded.server.got[0]?.body.waited_by, "wall-clock");

  const { time, origins } = reloaded;
  const stamp = origins.stamp();
  origins.sight(true);
  time.wallMillis += 300_000;
  origins.sight(false);
  const asleep = origins.tell(stamp);
  assert.deepEqual([asleep.waited_millis, asleep.waited_by], [300_000, "wall-clock"]);
  assert.equal(
    origins.tell(origins.stamp()).waited_by,
    "page-clock",
    "what is said after it is not affected",
  );
});
