import assert from "node:assert/strict";
import { test } from "node:test";

import { drawAndAcknowledge, readFrame } from "../static/shared/pacing.js";
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
  return {
    notes,
    page: {
      decode: async (/** @type {Uint8Array} */ jpeg) => `${jpeg.length} bytes`,
      draw: (/** @type {{ frame: number }} */ header, /** @type {string} */ picture) => {
        notes.push(`draw ${header.frame}: ${picture}`);
      },
      acknowledge: (/** @type {number} */ frame) => {
        notes.push(`acknowledge ${frame}`);
      },
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

test("a picture is acknowledged after it was drawn, once", async () => {
  const { notes, page } = notingPage();
  await drawAndAcknowledge(FRAME, page);
  assert.deepEqual(notes, ["draw 7: 4 bytes", "acknowledge 7"]);
});

test("nothing is acknowledged while a picture is being decoded", async () => {
  const { notes, page } = notingPage();
  /** @type {(picture: string) => void} */
  let decoded = () => {};
  const decode = () =>
    new Promise((/** @type {(picture: string) => void} */ done) => {
      decoded = done;
    });
  const drawn = drawAndAcknowledge(FRAME, { ...page, decode });
  await settle();
  assert.deepEqual(notes, []);

  decoded("slow");
  await drawn;
  assert.deepEqual(notes, ["draw 7: slow", "acknowledge 7"]);
});

test("a picture that cannot be decoded or drawn is acknowledged too: the next may be good", async () => {
  const broken = notingPage();
  const decode = async () => {
    throw new Error("no JPEG");
  };
  await drawAndAcknowledge(FRAME, { ...broken.page, decode });
  assert.deepEqual(broken.notes, ["complain: no JPEG", "acknowledge 7"]);

  const undrawn = notingPage();
  const draw = () => {
    throw new Error("no canvas");
  };
  await drawAndAcknowledge(FRAME, { ...undrawn.page, draw });
  assert.deepEqual(undrawn.notes, ["complain: no canvas", "acknowledge 7"]);
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
