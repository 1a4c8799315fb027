import assert from "node:assert/strict";
import { test } from "node:test";

import { lengthOf, linePath, powerAt, powerOf, Scale } from "../static/researcher/timeline.js";
import {
  description,
  outstandingWords,
  seenWords,
  setAsideWords,
} from "../static/researcher/timeline_words.js";

/** @type {Api.Timeline} */
const EMPTY = {
  absences: [],
  choices: [],
  comments: [],
  holds: [],
  patch_stays: false,
  pauses: [],
  points: [],
  set_aside: [],
  settings: [],
  sights: [],
};

/**
 * A point of setting 1, unless `rest` says otherwise.
 *
 * @param {number} seconds
 * @param {number} asked
 * @param {Partial<Api.TimelinePoint>} [rest]
 * @returns {Api.TimelinePoint}
 */
const point = (seconds, asked, rest = {}) => ({
  seconds,
  asked,
  frame: seconds * 10,
  setting: 1,
  patch_x: 240,
  patch_y: 120,
  ...rest,
});

/** @type {Api.TimelineComment} */
const COMMENT = {
  key: "1",
  kind: "text",
  text: "Said",
  at: "2026-01-01T00:00:00Z",
  late: false,
  withdrawn: false,
  seconds: 0,
};

test("the timeline is as long as the last thing that happened, whatever that is", () => {
  assert.equal(lengthOf(EMPTY), 1, "and never without a length");
  assert.equal(lengthOf({ ...EMPTY, settings: [{ setting: 1, from: 2, to: 30 }] }), 30);
  assert.equal(lengthOf({ ...EMPTY, settings: [{ setting: 1, from: 2 }] }), 2, "a setting still under way");
  assert.equal(lengthOf({ ...EMPTY, pauses: [{ reason: "lamp", from: 4, to: 44 }] }), 44);
  assert.equal(lengthOf({ ...EMPTY, absences: [{ reason: "away", from: 4, to: 45 }] }), 45);
  assert.equal(lengthOf({ ...EMPTY, points: [point(1, 0), point(50, 0)] }), 50);
  assert.equal(lengthOf({ ...EMPTY, comments: [{ ...COMMENT, seconds: 61 }] }), 61);
  assert.equal(lengthOf(EMPTY, [{ from: 3, to: 65 }]), 65, "a recording goes on in the closing questions");
  const aside = { key: "1", at: "", late: true, question: "q", text: "", value: 1, seconds: 70 };
  assert.equal(lengthOf({ ...EMPTY, set_aside: [aside] }), 70);
});

test("moments and powers lie where the drawing's edges say", () => {
  // 1056 wide: 44 left, 12 right, so 1000 pixels for 100 seconds.
  // 260 high: 42 above, 26 below, so 192 for a power of 1.
  const scale = new Scale(100, 1056);
  assert.deepEqual([scale.x(0), scale.x(50), scale.x(100)], [44, 544, 1044]);
  assert.deepEqual([scale.y(0), scale.y(0.5), scale.y(1)], [234, 138, 42]);
});

test("a span is as wide as it is long, to the end where it has none, and never too narrow to see", () => {
  const scale = new Scale(100, 1056);
  assert.deepEqual(scale.box({ from: 10, to: 30 }, 1), { x: 144, y: 42, width: 200, height: 192 });
  assert.equal(scale.box({ from: 90, to: null }, 1).width, 100);
  assert.equal(scale.box({ from: 10, to: 10.1 }, 2).width, 2);
});

test("times are written at round steps with room between them", () => {
  // 900 pixels have space for ten labels of 90 pixels each.
  assert.deepEqual(new Scale(50, 900).ticks(), [0, 5, 10, 15, 20, 25, 30, 35, 40, 45, 50]);
  assert.deepEqual(new Scale(51, 900).ticks(), [0, 10, 20, 30, 40, 50]);
  assert.deepEqual(new Scale(600, 900).ticks().slice(0, 3), [0, 60, 120]);
  assert.deepEqual(new Scale(9000, 900).ticks().slice(0, 3), [0, 900, 1800]);
  assert.deepEqual(new Scale(36_000, 900).ticks().slice(0, 3), [0, 3600, 7200]);
});

test("a power is the measured one, or else the one asked for", () => {
  assert.equal(powerOf(point(0, 0.4, { measured: 0.6 })), 0.6);
  assert.equal(powerOf(point(0, 0.4, { measured: 0 })), 0);
  assert.equal(powerOf(point(0, 0.4, { measured: null })), 0.4);
});

test("a comment stands at the power of the nearest point, or in the middle without a path", () => {
  const points = [point(10, 0.1), point(20, 0.2), point(30, 0.3)];
  assert.equal(powerAt(points, 0), 0.1);
  assert.equal(powerAt(points, 24), 0.2);
  assert.equal(powerAt(points, 26), 0.3);
  assert.equal(powerAt([], 26), 0.5);
});

test("a path breaks between settings, where there is no value, and where frames were counted anew", () => {
  const scale = new Scale(100, 1056);
  const points = [
    point(0, 0),
    point(10, 1),
    point(20, 0, { setting: 2 }),
    point(30, 1, { setting: 2 }),
    point(40, 1, { setting: 2, frame: 1 }),
    point(50, 0, { setting: 2 }),
  ];
  const asked = linePath(points, ({ asked }) => asked, scale);
  assert.equal(asked, "M44.0 234.0L144.0 42.0M244.0 234.0L344.0 42.0M444.0 42.0L544.0 234.0");

  const gap = [point(0, 0, { optimal: 1 }), point(10, 0), point(20, 0, { optimal: 1 })];
  assert.equal(
    linePath(gap, ({ optimal }) => optimal, scale),
    "M44.0 42.0M244.0 42.0",
  );
  assert.equal(linePath([], powerOf, scale), "");
});

test("the words for a screen reader count what is drawn", () => {
  const settings = [{ setting: 1, from: 0, to: 9 }];
  const plain = description({ ...EMPTY, settings }, false);
  assert.equal(plain, "Timeline: 1 setting, 0 comments. The comments follow as a list.");
  const pauses = [{ reason: "lamp", from: 1, to: 2 }];
  const more = description({ ...EMPTY, settings, pauses, comments: [COMMENT] }, true);
  assert.equal(more, "Focal power over time: 1 setting, 1 pause, 1 comment. The comments follow as a list.");
});

test("an answer that does not count says why, and what counts instead", () => {
  const late = { value: [4, 0, 2], counted: null, late: true };
  assert.equal(setAsideWords(late), "4, –, 2 (arrived too late)");
  const other = { value: 3, counted: 5, late: false };
  assert.equal(setAsideWords(other), "3 (another device gave a different answer later; 5 counts)");
});

test("a tablet's outstanding comments are mentioned if there may be any", () => {
  const timeOf = (/** @type {string} */ moment) => moment.slice(11, 16);
  assert.equal(outstandingWords(null, timeOf), null);
  const until = { counts_until: "2026-01-01T10:30:00Z", devices: 2 };
  assert.equal(
    outstandingWords(until, timeOf),
    "Comments and answers still on a tablet count until 10:30. " +
      "2 tablets have not confirmed since the end that everything was sent.",
  );
});

test("beside a comment stands what the surgeon saw, as far as it is known", () => {
  assert.equal(seenWords({ picture_width: 512, pictures_per_second: 2.5 }), "512 px, 3/s");
  assert.equal(seenWords({ picture_width: 2048 }), "2048 px");
  assert.equal(seenWords({ picture_width: null, pictures_per_second: null }), "");
});
