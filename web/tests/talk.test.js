import assert from "node:assert/strict";
import { test } from "node:test";

import { Grip } from "../static/surgeon/grip.js";
import { loudness, MicrophoneTrouble, refusalWords } from "../static/surgeon/microphone.js";
import { LIMIT_MS, Talk } from "../static/surgeon/talk.js";
import { isTalkKey } from "../static/surgeon/talk_keys.js";
import { FakeTime, settle } from "./around.js";

const PLACE = { session: "s", segment: "g", setting: 1, frame: 7, run: 1 };

/** A surgeon's page with a microphone that a test controls. */
function openPage() {
  const time = new FakeTime();
  /** What reached the outbox, abbreviated. @type {string[]} */
  const kept = [];
  const outbox = {
    begin: (/** @type {{ frame: number | null }} */ { frame }) => {
      kept.push(`begin ${frame}`);
      return "c";
    },
    add: (/** @type {{ piece: number, through_ms: number, ended: string | null }} */ piece) =>
      kept.push(`${piece.piece} ${piece.through_ms} ${piece.ended ?? ""}`.trim()),
  };

  const microphone = {
    /** @type {import("../static/surgeon/microphone.js").Heard | null} */
    heard: null,
    stops: 0,
    /** Answers the request for the microphone. @type {(error?: Error) => void} */
    opened: () => {},
  };
  const record = (/** @type {import("../static/surgeon/microphone.js").Heard} */ heard) => {
    microphone.heard = heard;
    const stop = () => {
      microphone.stops += 1;
    };
    return new Promise((resolve, reject) => {
      microphone.opened = (error) =>
        error ? reject(error) : resolve({ type: "audio/mp4", level: () => 0.5, stop });
    });
  };

  let place = PLACE;
  const talk = new Talk({
    outbox: /** @type {any} */ (outbox),
    record: /** @type {any} */ (record),
    here: () => place,
    stamp: () => ({
      device: "tablet",
      sequence: 1,
      client_millis: time.wall(),
      clock: { page: "page", at: time.wall(), slept: 0 },
    }),
    now: time.page,
    later: time.later,
    changed: () => {},
  });
  /** @param {Partial<typeof PLACE>} to */
  const move = (to) => {
    place = { ...PLACE, ...to };
  };
  return { time, kept, microphone, talk, move };
}

/** @param {ReturnType<typeof openPage>} page */
async function begin({ talk, microphone }) {
  talk.press();
  microphone.opened();
  await settle();
  microphone.heard?.started();
}

const SOUND = new Blob(["sound"]);

test("a recording belongs to the moment of the press, and ends with its reason", async () => {
  const page = openPage();
  page.talk.press();
  assert.deepEqual([page.talk.state, page.talk.label], ["opening", "Wait…"]);
  page.move({ frame: 99 });
  page.microphone.opened();
  await settle();
  page.microphone.heard?.started();
  assert.deepEqual([page.talk.state, page.talk.level], ["recording", 0.5]);

  await page.time.pass(1000);
  page.microphone.heard?.piece(SOUND);
  assert.equal(page.talk.label, "Recording 0:01");
  await page.time.pass(400);
  page.talk.release();
  assert.equal(page.microphone.stops, 1);
  page.microphone.heard?.piece(SOUND);
  page.microphone.heard?.stopped();
  await settle();
  assert.deepEqual(page.kept, ["begin 7", "1 1000", "2 1400", "3 1400 released"]);
  assert.deepEqual([page.talk.state, page.talk.trouble], ["idle", ""]);
});

test("a piece that the browser cannot give back ends the recording and loses nothing else", async () => {
  const page = openPage();
  await begin(page);
  page.microphone.heard?.piece(SOUND);
  page.microphone.heard?.piece(
    /** @type {any} */ ({ arrayBuffer: () => Promise.reject(new Error("NotReadable")) }),
  );
  page.microphone.heard?.piece(SOUND);
  await settle();
  assert.equal(page.microphone.stops, 1);
  page.microphone.heard?.stopped();
  await settle();
  assert.deepEqual(page.kept, ["begin 7", "1 0", "3 0", "4 0 microphone-lost"]);
  assert.match(page.talk.trouble, /What you said until then is kept/);
});

test("a pedal held for an hour ends after two minutes, with a warning, and records again only when pressed", async () => {
  const page = openPage();
  await begin(page);
  await page.time.pass(LIMIT_MS - 10_000);
  assert.equal(page.talk.label, "Ends in 10 s");
  await page.time.pass(10_000);
  assert.equal(page.microphone.stops, 1);
  page.microphone.heard?.stopped();
  await settle();
  assert.equal(page.kept.at(-1), "1 120000 limit");
  assert.match(page.talk.trouble, /ended after two minutes\. What you said is kept/);

  await page.time.pass(3_600_000);
  page.talk.release();
  assert.equal(page.talk.state, "idle");
});

test("a pedal on which something lies does not keep a finger from talking", async () => {
  const page = openPage();
  const grip = new Grip(page.talk);
  /** The microphone opens, and the recording begins. */
  const record = async () => {
    page.microphone.opened();
    await settle();
    page.microphone.heard?.started();
  };

  grip.press("key F13");
  await record();
  grip.press("pointer 1");
  assert.equal(grip.release("pointer 1"), false, "one at a time");
  await page.time.pass(LIMIT_MS);
  page.microphone.heard?.stopped();
  await settle();
  grip.press("key F13");
  assert.equal(page.talk.state, "idle", "it was never let go");

  grip.press("pointer 1");
  await record();
  assert.equal(grip.release("key F13"), false);
  assert.equal(page.talk.state, "recording", "the pedal ends nobody else's recording");
  assert.equal(grip.release("pointer 1"), true);
  page.microphone.heard?.stopped();
  await settle();
  assert.deepEqual(page.kept, ["begin 7", "1 120000 limit", "begin 7", "1 0 released"]);

  grip.press("key F13");
  await record();
  assert.equal(page.talk.state, "recording", "let go and pressed anew, it talks");
});

test("something that comes in front of the page ends the recording, and the surgeon reads why", async () => {
  const page = openPage();
  const grip = new Grip(page.talk);
  grip.press("pointer 1");
  page.microphone.opened();
  await settle();
  page.microphone.heard?.started();
  page.microphone.heard?.piece(SOUND);
  grip.leave();
  page.microphone.heard?.stopped();
  await settle();
  assert.equal(page.kept.at(-1), "2 0 left");
  assert.match(page.talk.trouble, /in front of this page\. What you said until then is kept\. Press again/);

  page.talk.press();
  assert.equal(page.talk.trouble, "");
});

test("a microphone that is taken away ends the recording, and its sound is kept", async () => {
  const page = openPage();
  await begin(page);
  page.microphone.heard?.piece(SOUND);
  page.microphone.heard?.lost();
  page.microphone.heard?.stopped();
  await settle();
  assert.equal(page.kept.at(-1), "2 0 microphone-lost");
  assert.match(page.talk.trouble, /taken away\. What you said until then is kept/);
});

test("a refused microphone is reported in a sentence, and leaves no comment", async () => {
  const page = openPage();
  page.talk.press();
  page.microphone.opened(new MicrophoneTrouble(refusalWords("NotAllowedError")));
  await settle();
  assert.deepEqual(page.kept, []);
  assert.match(page.talk.trouble, /blocked for this page/);
  assert.equal(page.talk.state, "idle");
  assert.equal(page.talk.press(), true, "and can be tried again");
  assert.equal(page.talk.trouble, "");
});

test("let go before the microphone was open: nothing is kept, and the page says what to do", async () => {
  const page = openPage();
  page.talk.press();
  page.talk.release();
  page.microphone.opened();
  await settle();
  page.microphone.heard?.started();
  page.microphone.heard?.piece(SOUND);
  page.microphone.heard?.stopped();
  await settle();
  assert.deepEqual(page.kept, []);
  assert.match(page.talk.trouble, /Nothing was recorded/);
  assert.equal(page.talk.state, "idle");
});

test("keys talk where they do nothing else", () => {
  const talks = (/** @type {string} */ key, /** @type {"field" | "control" | "page"} */ focus) =>
    isTalkKey({ key }, focus);
  assert.deepEqual([talks(" ", "page"), talks(" ", "control"), talks(" ", "field")], [true, false, false]);
  assert.deepEqual(
    [talks("PageDown", "page"), talks("PageDown", "control"), talks("PageDown", "field")],
    [true, true, false],
  );
  assert.deepEqual([talks("F13", "field"), talks("F24", "page"), talks("F5", "page")], [true, true, false]);
  assert.equal(isTalkKey({ key: " ", ctrlKey: true }, "page"), false);
});

test("the meter shows full scale as 1, -30 dB as a half and silence as 0", () => {
  assert.equal(loudness(new Float32Array(8).fill(1)), 1);
  assert.ok(Math.abs(loudness(new Float32Array(8).fill(10 ** (-30 / 20))) - 0.5) < 1e-6);
  assert.equal(loudness(new Float32Array(8)), 0);
});
