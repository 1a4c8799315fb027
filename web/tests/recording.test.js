// The texts about recordings on the operator's page.

import assert from "node:assert/strict";
import { test } from "node:test";

import { amount, diskWords, lasting, nowWords } from "../static/operator/recording_words.js";

/** @type {Api.RecordingStatus} */
const IDLE = {
  unavailable: null,
  recording: null,
  folder: null,
  by_protocol: false,
  seconds: null,
  frames: 0,
  lost: 0,
  bytes: 0,
  bytes_per_second: 40e6,
  free_bytes: 145e9,
  reserve_bytes: 1e9,
  seconds_left: 3600,
  notice: null,
  notice_warns: false,
};

test("lengths of time and amounts are as exact as it helps", () => {
  assert.equal(lasting(59), "59 s");
  assert.equal(lasting(150), "3 min");
  assert.equal(lasting(3599), "1 h 0 min");
  assert.equal(lasting(3 * 3600 + 25 * 60), "3 h 25 min");
  assert.equal(lasting(80 * 3600), "3 days");
  assert.equal(amount(999), "1 kB");
  assert.equal(amount(40e6), "40 MB");
  assert.equal(amount(145e9), "145.0 GB");
});

test("before it starts, the time that fits on the disk is shown", () => {
  assert.equal(nowWords(IDLE), "Nothing is being recorded.");
  assert.equal(
    diskWords(IDLE),
    "The disk lasts for about 1 h 0 min at 40 MB a second (145.0 GB free; the trial’s reserve is 1.0 GB).",
  );
  const unmeasured = { ...IDLE, bytes_per_second: null, seconds_left: null };
  assert.equal(diskWords(unmeasured), "The disk has 145.0 GB free; the trial’s reserve is 1.0 GB.");
});

test("while it runs, lost frames and the protocol's request are shown", () => {
  /** @type {Api.RecordingStatus} */
  const running = { ...IDLE, recording: "mosaic", seconds: 61.9, frames: 1500, bytes: 2.4e9 };
  assert.equal(nowWords(running), "Recording mosaics: 1 min, 1500 frames, 2.4 GB.");
  /** @type {Api.RecordingStatus} */
  const view = { ...running, recording: "view", by_protocol: true, lost: 3 };
  assert.equal(
    nowWords(view),
    "Recording the view, as the protocol asks: 1 min, 1500 frames, 3 lost, 2.4 GB.",
  );
});
