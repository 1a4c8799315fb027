import assert from "node:assert/strict";
import { test } from "node:test";

import { Pictures, readFrame } from "../static/shared/pacing.js";
import { Reconnection } from "../static/shared/reconnection.js";
import { settle } from "./around.js";

/**
 * A frame message as the server builds it, byte by byte.
 *
 * @param {string} header
 * @param {number[]} jpeg
 */
function message(header, jpeg) {
  const text = new TextEncoder().encode(header);
  return Uint8Array.of(text.length % 256, text.length >> 8, ...text, ...jpeg).buffer;
}

const FRAME = message('{"frame": 7}', [0xff, 0xd8, 1, 2]);

/** A page that notes each call, in order. */
function notingPage() {
  /** @type {string[]} */
  const notes = [];
  const clock = { ms: 1000 };
  return {
    notes,
    clock,
    page: {
      decode: async (/** @type {Uint8Array} */ jpeg) => `${jpeg.length} bytes`,
      draw: (/** @type {{ frame: number }} */ header, /** @type {string} */ picture) => {
        notes.push(`draw ${header.frame}: ${picture}`);
      },
      acknowledge: (
        /** @type {number} */ frame,
        /** @type {number} */ held,
        /** @type {boolean} */ shown,
      ) => {
        notes.push(`acknowledge ${frame}${shown ? "" : " unseen"} after ${held} ms`);
      },
      now: () => clock.ms,
      complain: (/** @type {unknown} */ error) => {
        notes.push(`complain: ${error instanceof Error ? error.message : error}`);
      },
    },
  };
}

test("a message holds a header of the length that it states, then the picture", () => {
  // 300 bytes, so that both bytes of the length count.
  const padding = "x".repeat(300 - '{"frame": 1, "note": ""}'.length);
  const header = `{"frame": 1, "note": "${padding}"}`;
  const { header: read, jpeg } = readFrame(message(header, [9, 8, 7]));
  assert.equal(read.frame, 1);
  assert.deepEqual([...jpeg], [9, 8, 7]);
});

test("a picture that came before the page's scripts is as old as it is", async () => {
  const { notes, page, clock } = notingPage();
  await new Pictures(page).take(FRAME, clock.ms - 400);
  assert.equal(notes.at(-1), "acknowledge 7 after 400 ms");
});

test("a picture is acknowledged after it was drawn, once", async () => {
  const { notes, page } = notingPage();
  await new Pictures(page).take(FRAME);
  assert.deepEqual(notes, ["draw 7: 4 bytes", "acknowledge 7 after 0 ms"]);
});

test("nothing is acknowledged while a picture is being decoded", async () => {
  const { notes, page, clock } = notingPage();
  /** @type {(picture: string) => void} */
  let decoded = () => {};
  const decode = () =>
    new Promise((/** @type {(picture: string) => void} */ done) => {
      decoded = done;
    });
  const drawn = new Pictures({ ...page, decode }).take(FRAME);
  await settle();
  assert.deepEqual(notes, []);

  clock.ms += 30;
  decoded("slow");
  await drawn;
  assert.deepEqual(notes, ["draw 7: slow", "acknowledge 7 after 30 ms"]);
});

test("a picture that cannot be decoded or drawn is acknowledged too: the next may be good", async () => {
  const broken = notingPage();
  const decode = async () => {
    throw new Error("no JPEG");
  };
  await new Pictures({ ...broken.page, decode }).take(FRAME);
  assert.deepEqual(broken.notes, ["complain: no JPEG", "acknowledge 7 unseen after 0 ms"]);

  const undrawn = notingPage();
  const draw = () => {
    throw new Error("no canvas");
  };
  await new Pictures({ ...undrawn.page, draw }).take(FRAME);
  assert.deepEqual(undrawn.notes, ["complain: no canvas", "acknowledge 7 unseen after 0 ms"]);
});

test("of pictures that arrive while one is being decoded only the newest is drawn, and all are acknowledged in order", async () => {
  const { notes, page } = notingPage();
  /** @type {(() => void)[]} */
  const decoded = [];
  const decode = () =>
    new Promise((/** @type {(picture: string) => void} */ done) => {
      decoded.push(() => done("a picture"));
    });
  const pictures = new Pictures({ ...page, decode });
  for (const frame of [7, 8, 9]) pictures.take(message(`{"frame": ${frame}}`, [1]));
  decoded[0]?.();
  await settle();
  assert.equal(decoded.length, 2, "the one in between is not decoded");
  decoded[1]?.();
  await settle();
  const acknowledged = [
    "acknowledge 7 after 0 ms",
    "acknowledge 8 unseen after 0 ms",
    "acknowledge 9 after 0 ms",
  ];
  assert.deepEqual(notes, [
    "draw 7: a picture",
    ...acknowledged.slice(0, 2),
    "draw 9: a picture",
    acknowledged[2],
  ]);
});

test("waits between attempts double from 250 ms to 5 s, a quarter more or less, and begin anew once connected", () => {
  const connection = new Reconnection();
  const waits = Array.from({ length: 7 }, () => connection.nextWait(0.5));
  assert.deepEqual(waits, [250, 500, 1000, 2000, 4000, 5000, 5000]);

  connection.opened();
  assert.equal(connection.nextWait(0), 187.5);
  connection.opened();
  assert.equal(connection.nextWait(1), 312.5);
});

test("a connection is dead after twelve seconds without a word, and not before", () => {
  const connection = new Reconnection();
  connection.heard(100_000);
  assert.equal(connection.isSilent(112_000), false);
  assert.equal(connection.isSilent(112_001), true);
  connection.heard(112_001);
  assert.equal(connection.isSilent(112_002), false);
});
