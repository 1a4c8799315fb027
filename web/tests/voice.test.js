import assert from "node:assert/strict";
import { test } from "node:test";

import { Refused } from "../static/shared/api.js";
import { say } from "../static/shared/language.js";
import { Origins } from "../static/surgeon/origin.js";
import { VoiceOutbox } from "../static/surgeon/voice_outbox.js";
import { heldWords } from "../static/surgeon/words.js";
import { countedIds, FakeDisk, FakeTime, fakeStore, settle } from "./around.js";

const PLACE = { session: "s", segment: "g", setting: 1, frame: 7, run: 1 };
const noNetwork = () => new TypeError("Failed to fetch");

/** @typedef {import("../static/surgeon/voice_outbox.js").Step} Step */

/** A page on `store`, with a server whose answers a test sets. */
function openPage(
  store = /** @type {FakeDisk<Step>} */ (new FakeDisk()),
  time = new FakeTime(),
  newId = countedIds(),
) {
  /** What the server received, abbreviated. @type {string[]} */
  const got = [];
  /** The server's answers, in order: an error to throw, or null to accept. @type {(Error | null)[]} */
  const answers = [];
  const take = (/** @type {string} */ what) => {
    got.push(what);
    const answer = answers.shift();
    return answer ? Promise.reject(answer) : Promise.resolve();
  };

  const origins = new Origins(fakeStore(), time, newId);
  const open = () =>
    new VoiceOutbox({
      store,
      origins,
      send: (_, body) => take(`begin ${/** @type {any} */ (body).kind} ${/** @type {any} */ (body).frame}`),
      sendAudio: (path, audio, type) => take(`${path.split("/").at(-1)} ${audio.byteLength} ${type}`),
      newId,
      wall: time.wall,
      later: time.later,
    });
  return { store, time, got, answers, origins, open };
}

/** @param {VoiceOutbox} outbox @param {string} comment @param {number} piece @param {"released" | null} [ended] */
function add(outbox, comment, piece, ended = null) {
  const audio = new ArrayBuffer(ended ? 0 : 10 * piece);
  outbox.add({ comment, session: "s", piece, type: "audio/mp4", through_ms: 1000 * piece, ended, audio });
}

test("a recording is sent while it is spoken, in order, and taken off the device once saved", async () => {
  const page = openPage();
  const outbox = page.open();
  const comment = outbox.begin(PLACE, page.origins.stamp());
  await settle();
  assert.deepEqual(page.got, ["begin voice 7"]);

  add(outbox, comment, 1);
  await settle();
  add(outbox, comment, 2);
  add(outbox, comment, 3, "released");
  await settle();
  assert.deepEqual(page.got.slice(1), [
    "1?session=s&through_ms=1000 10 audio/mp4",
    "2?session=s&through_ms=2000 20 audio/mp4",
    "3?session=s&through_ms=3000&ended=released 0 audio/mp4",
  ]);
  assert.equal(page.store.kept.size, 0);
  assert.deepEqual([outbox.waiting, outbox.held("s"), outbox.status.text], [0, 0, "Recording saved"]);
});

test("what a closed tab has left is sent by an open one, once", async () => {
  const page = openPage();
  const open = page.open();
  await open.ready;
  const other = openPage(page.store, page.time);
  other.answers.push(...Array.from({ length: 9 }, noNetwork));
  other.open().begin(PLACE, other.origins.stamp());
  await settle();

  open.wake();
  await open.ready;
  await settle();
  open.wake();
  await open.ready;
  await settle();
  assert.deepEqual(page.got, ["begin voice 7"]);
  assert.equal(page.store.kept.size, 0);
});

test("without a network everything stays on the device and lands in order, over a reload too", async () => {
  const page = openPage();
  const outbox = page.open();
  page.answers.push(...Array.from({ length: 4 }, noNetwork));
  const comment = outbox.begin(PLACE, page.origins.stamp());
  add(outbox, comment, 1);
  await settle();
  assert.equal(page.store.kept.size, 2);
  assert.equal(outbox.waiting, 1, "one recording, however many pieces");
  assert.deepEqual([outbox.heldUp, outbox.trouble, outbox.status.text], [1, say("no-connection"), ""]);

  // The page is loaded again, and the network is back.
  page.answers.length = 0;
  page.got.length = 0;
  const again = page.open();
  await again.ready;
  await settle();
  assert.deepEqual(page.got, ["begin voice 7", "1?session=s&through_ms=1000 10 audio/mp4"]);
  assert.equal(page.store.kept.size, 0);
});

test("a recording that the server refuses stays on the device and stops no other", async () => {
  const page = openPage();
  const outbox = page.open();
  page.answers.push(new Refused(409, "this trial does not record voice", true));
  const refused = outbox.begin(PLACE, page.origins.stamp());
  add(outbox, refused, 1);
  const other = outbox.begin({ ...PLACE, frame: 8 }, page.origins.stamp());
  add(outbox, other, 1);
  await settle();

  assert.deepEqual(page.got, ["begin voice 7", "begin voice 8", "1?session=s&through_ms=1000 10 audio/mp4"]);
  assert.equal(page.store.kept.size, 2, "both steps of the refused one");
  assert.deepEqual(
    [outbox.waiting, outbox.held("s"), outbox.refused("s"), outbox.refused("t")],
    [0, 1, 1, 0],
  );
  assert.match(outbox.status.text, /this trial does not record voice/);
});

test("a device without room says so, and sends all the same", async () => {
  const page = openPage();
  page.store.full = true;
  const outbox = page.open();
  page.answers.push(noNetwork(), noNetwork());
  const comment = outbox.begin(PLACE, page.origins.stamp());
  await settle();
  assert.equal(outbox.durable, false);
  assert.equal(outbox.heldUp, 1);

  add(outbox, comment, 1);
  await settle();
  await page.time.pass(1000);
  assert.equal(outbox.waiting, 0);
  assert.equal(outbox.durable, true);
});

test("nothing that was said is called kept before this device has it", async () => {
  const page = openPage();
  const outbox = page.open();
  page.answers.push(...Array.from({ length: 9 }, noNetwork));
  const comment = outbox.begin(PLACE, page.origins.stamp());
  assert.equal(outbox.isKeeping, true);
  await settle();
  assert.equal(outbox.isKeeping, false);

  let free = () => {};
  page.store.busy = new Promise((resolve) => {
    free = resolve;
  });
  add(outbox, comment, 1);
  assert.equal(outbox.isKeeping, false, "the second that is being spoken");
  add(outbox, comment, 2);
  assert.equal(outbox.isKeeping, true, "this device is more than a second behind");
  free();
  await settle();
  assert.equal(outbox.isKeeping, false);

  add(outbox, comment, 3, "released");
  assert.equal(outbox.isKeeping, true, "the end is not there yet");
  await settle();
  assert.deepEqual([outbox.isKeeping, page.store.kept.size, outbox.heldUp], [false, 4, 1]);
});

test("a device that cannot be read at first is read again, and what it keeps is sent", async () => {
  const page = openPage();
  page.answers.push(noNetwork());
  page.open().begin(PLACE, page.origins.stamp());
  await settle();
  page.store.unreadable = true;
  const again = openPage(page.store);
  const outbox = again.open();
  await outbox.ready;
  await settle();
  assert.deepEqual([again.got, outbox.waiting], [[], 0]);

  page.store.unreadable = false;
  await again.time.pass(2000);
  await settle();
  assert.deepEqual(again.got, ["begin voice 7"]);
  assert.equal(page.store.kept.size, 0);
});

test("one line tells everything that waits, where it is, and what becomes of it", () => {
  const held = { comments: 3, recordings: 1, durable: true, trouble: say("no-connection") };
  assert.equal(heldWords(held), "Saved here: 3 comments, 1 recording. Sent when the network is back.");
  assert.equal(heldWords({ ...held, comments: 0, trouble: null }), "Saved here: 1 recording.");
  assert.equal(
    heldWords({ ...held, recordings: 0, durable: false, trouble: "The disk is full." }),
    "Kept on this page only, so do not close it: 3 comments. The disk is full.",
  );
});
