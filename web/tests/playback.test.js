// Playing a recording: which frame is on screen at a time, how playback moves, and how its pictures are loaded.

import assert from "node:assert/strict";
import { test } from "node:test";

import { Pictures } from "../static/researcher/pictures.js";
import { chosenPatchAt, momentText, valuesAt, whyNoPicture } from "../static/researcher/player_words.js";
import { Playhead } from "../static/researcher/playhead.js";
import { lastComment, metricPath, Scale, settingAt } from "../static/researcher/timeline.js";
import { Track } from "../static/researcher/track.js";
import { Refused } from "../static/shared/api.js";

/**
 * A recording of `count` frames, one every `ms` milliseconds.
 *
 * @param {string} name
 * @param {number} from
 * @param {number} count
 * @param {number} [ms]
 * @returns {Api.RecordingCourse}
 */
const recording = (name, from, count, ms = 100) => ({
  name,
  kind: "mosaic",
  from,
  times_ms: Array.from({ length: count }, (_, frame) => frame * ms),
});

const always = () => true;

test("a frame is on screen from its exposure to the next, and nothing where nothing was recorded", () => {
  // The later recording is listed first. They cover 10 to 10.4 s and, after a restart, 20 to 20.4 s.
  const track = new Track([recording("S-2", 20, 5), recording("S", 10, 5)]);
  assert.equal(track.length, 10);
  assert.deepEqual(
    [9.9, 10, 10.05, 10.1, 10.4, 11.3, 11.5, 20.1].map((seconds) => track.at(seconds)),
    [null, 0, 0, 1, 4, 4, null, 6],
  );
  assert.deepEqual([track.place(0)?.recording.name, track.place(0)?.frame], ["S", 0]);
  assert.deepEqual([track.place(7)?.recording.name, track.place(7)?.frame], ["S-2", 2]);
  assert.deepEqual(track.spans(), [
    { from: 10, to: 10.4 },
    { from: 20, to: 20.4 },
  ]);
  assert.ok(Math.abs(track.rate - 10) < 1e-6);
});

test("playback keeps the recording's pace, passes over gaps, and stops at the end", () => {
  const track = new Track([recording("S", 10, 5), recording("S-2", 20, 5)]);
  const playhead = new Playhead(track);
  assert.deepEqual([playhead.seconds, playhead.frame], [10, 0]);

  playhead.play();
  playhead.advance(0.25, always);
  assert.deepEqual([playhead.seconds, playhead.frame], [10.25, 2]);
  playhead.speed = 2;
  playhead.advance(0.05, always);
  assert.equal(playhead.frame, 3);

  // From 10.35 s, 2 s later: past the end of the first recording.
  playhead.advance(1, always);
  assert.deepEqual([playhead.seconds, playhead.frame], [20, 5]);
  playhead.advance(5, always);
  assert.deepEqual([playhead.frame, playhead.playing], [9, false]);

  playhead.play();
  assert.equal(playhead.frame, 0, "from the start again");
});

test("playback waits for a picture that has not come, and shows what has", () => {
  const playhead = new Playhead(new Track([recording("S", 0, 100, 40)]));
  playhead.play();
  const upToThree = (/** @type {number} */ frame) => frame <= 3;
  playhead.advance(0.2, upToThree);
  assert.deepEqual([playhead.frame, playhead.waiting], [3, true]);
  playhead.advance(0.2, upToThree);
  assert.deepEqual([playhead.frame, playhead.waiting], [3, true], "and loses no time meanwhile");
  playhead.advance(0.04, always);
  assert.deepEqual([playhead.frame, playhead.waiting], [4, false]);
});

test("steps go frame by frame, over gaps too, and pause", () => {
  const playhead = new Playhead(new Track([recording("S", 10, 3), recording("S-2", 20, 3)]));
  playhead.play();
  playhead.step(1);
  assert.deepEqual([playhead.frame, playhead.playing], [1, false]);
  playhead.step(1);
  playhead.step(1);
  assert.equal(playhead.frame, 3);
  playhead.step(-1);
  assert.equal(playhead.frame, 2);
  playhead.step(-9);
  assert.equal(playhead.frame, 0);

  playhead.seek(15);
  assert.equal(playhead.frame, null);
  playhead.step(-1);
  assert.equal(playhead.frame, 2, "the frame before the gap");
  playhead.seek(15);
  playhead.step(1);
  assert.equal(playhead.frame, 3);
  playhead.seek(5);
  playhead.step(1);
  assert.equal(playhead.frame, 0, "before the first frame");
});

test("fast playback needs no more pictures than can be told apart", () => {
  // 50 frames a second at four times the pace are 200 a second. Every seventh of them makes 29 a second.
  const playhead = new Playhead(new Track([recording("S", 0, 1000, 20)]));
  playhead.speed = 4;
  playhead.play();
  assert.deepEqual(playhead.needed(4), [0, 7, 14, 21]);
  playhead.pause();
  playhead.seek(0.1);
  assert.deepEqual(playhead.needed(4), [5, 6, 4, 7], "the neighbours, where it stands");
});

/** A server whose answers a test gives by hand. */
function fakeServer() {
  /** @type {Map<number, { resolve: (picture: string) => void, reject: (error: unknown) => void }>} */
  const asked = new Map();
  /** @type {number[]} */
  const aborted = [];
  return {
    asked,
    aborted,
    /** @type {(frame: number, signal: AbortSignal) => Promise<string>} */
    load: (frame, signal) =>
      new Promise((resolve, reject) => {
        asked.set(frame, { resolve, reject });
        signal.addEventListener("abort", () => {
          aborted.push(frame);
          reject(new Error("aborted"));
        });
      }),
  };
}

const settled = () => new Promise((done) => setImmediate(done));

test("pictures are asked for a few at a time, the most urgent first, and no longer when not needed", async () => {
  const server = fakeServer();
  /** @type {number[]} */
  const arrived = [];
  const pictures = new Pictures({
    load: server.load,
    explain: () => null,
    arrived: (frame) => arrived.push(frame),
    failed: (error) => assert.fail(String(error)),
    atOnce: 2,
  });

  pictures.want([5, 6, 7]);
  assert.deepEqual([...server.asked.keys()], [5, 6]);
  server.asked.get(5)?.resolve("five");
  await settled();
  assert.deepEqual([arrived, [...server.asked.keys()]], [[5], [5, 6, 7]]);
  assert.deepEqual(pictures.get(5), { picture: "five", problem: null });

  pictures.want([40]);
  await settled();
  assert.deepEqual(server.aborted, [6, 7]);
  assert.equal(server.asked.has(40), true);
});

test("only what is wrong with a frame is told of it: a server that is busy or restarts is asked again", () => {
  assert.equal(whyNoPicture(new Refused(500, "frame 3 is damaged", true)), "frame 3 is damaged");
  assert.equal(whyNoPicture(new Refused(409, "the participant withdrew", true)), "the participant withdrew");
  assert.equal(whyNoPicture(new Refused(500, "a proxy’s error", false)), null);
  assert.equal(whyNoPicture(new Refused(502, "a proxy’s error", false)), null);
  assert.equal(whyNoPicture(new Refused(503, "busy", true)), null);
  assert.equal(whyNoPicture(new Refused(507, "the disk cannot be read", true)), null);
  assert.equal(whyNoPicture(new Refused(403, "sign in", true, true)), null);
  assert.equal(whyNoPicture(new TypeError("no network")), null);
});

test("a frame that the server cannot read is told once, and a server that does not answer is no damage", async () => {
  const server = fakeServer();
  /** @type {unknown[]} */
  const failed = [];
  const pictures = new Pictures({
    load: server.load,
    explain: (error) => (error === "damaged" ? "frame 3 is damaged" : null),
    arrived: () => {},
    failed: (error) => failed.push(error),
  });

  pictures.want([3, 4]);
  server.asked.get(3)?.reject("damaged");
  server.asked.get(4)?.reject("no answer");
  await settled();
  assert.deepEqual(pictures.get(3), { picture: null, problem: "frame 3 is damaged" });
  assert.equal(pictures.get(4), undefined);
  assert.deepEqual(failed, ["no answer"]);
});

test("pictures far behind are forgotten, those that are needed stay", async () => {
  const server = fakeServer();
  const pictures = new Pictures({
    load: async (frame, signal) => {
      server.load(frame, signal).catch(() => {});
      return String(frame);
    },
    explain: () => null,
    arrived: () => {},
    failed: (error) => assert.fail(String(error)),
    kept: 3,
  });
  for (const frames of [[0, 1], [2, 3], [4]]) {
    pictures.want(frames);
    await settled();
  }
  assert.deepEqual(
    [0, 1, 2, 3, 4].map((frame) => pictures.get(frame)?.picture),
    [undefined, undefined, "2", "3", "4"],
  );
  pictures.clear();
  assert.equal(pictures.get(4), undefined);
});

/**
 * Plays `seconds` on a page that draws every 16.7 ms, from a server that takes 40 ms for a picture.
 *
 * @param {Track} track
 * @param {number} speed
 * @param {number} seconds
 */
async function playOnPage(track, speed, seconds) {
  let now = 0;
  let aborted = 0;
  /** @type {{ due: number, answer: () => void }[]} */
  let coming = [];
  const pictures = new Pictures({
    load: (frame, signal) =>
      new Promise((answer) => {
        coming.push({ due: now + 40, answer: () => answer(String(frame)) });
        signal.addEventListener("abort", () => {
          aborted += 1;
        });
      }),
    explain: () => null,
    arrived: () => {},
    failed: (error) => assert.fail(String(error)),
  });

  const playhead = new Playhead(track);
  const from = playhead.seconds;
  playhead.speed = speed;
  playhead.play();
  const drawn = new Set();
  for (; now < seconds * 1000 && playhead.playing; now += 1000 / 60) {
    for (const { answer } of coming.filter(({ due }) => due <= now)) answer();
    coming = coming.filter(({ due }) => due > now);
    await settled();
    playhead.advance(1 / 60, (frame) => pictures.get(frame) !== undefined);
    pictures.want(playhead.needed(25));
    if (playhead.frame !== null && pictures.get(playhead.frame)) drawn.add(playhead.frame);
  }
  return { moved: playhead.seconds - from, aborted, drawn: drawn.size };
}

for (const ms of [20, 1000 / 30, 40, 100]) {
  test(`playback of a frame every ${ms.toFixed()} ms keeps up at every speed, and asks for nothing in vain`, async () => {
    const track = new Track([recording("S", 0, Math.ceil(24_000 / ms), ms)]);
    for (const speed of [0.25, 0.5, 1, 2, 4]) {
      const { moved, aborted, drawn } = await playOnPage(track, speed, 5);
      const expected = 5 * speed;
      assert.ok(Math.abs(moved - expected) <= 0.05 * expected, `${speed}: ${moved} s of ${expected} s`);
      assert.equal(aborted, 0, `at speed ${speed}`);
      // All frames of the recording, but no more than a person can distinguish.
      const pictures = Math.min((1000 / ms) * speed, 20) * 5;
      assert.ok(drawn >= 0.9 * pictures, `${speed}: ${drawn} pictures of ${pictures}`);
    }
  });
}

test("playback that leaves frames out begins anew after a gap, and ends with the last frame", async () => {
  // 50 frames a second, of which every second one is wanted. The first recording has an odd number of frames.
  const track = new Track([recording("S", 0, 51, 20), recording("S-2", 10, 52, 20)]);
  const playhead = new Playhead(track);
  playhead.step(1);
  playhead.play();
  playhead.advance(0.96, always);
  assert.deepEqual(playhead.needed(4), [49, 51, 53, 55], "the frame after the gap is among them");
  playhead.advance(0.06, always);
  playhead.advance(1, always);
  assert.deepEqual([playhead.seconds, playhead.frame], [10, 51]);
  playhead.advance(2, always);
  assert.deepEqual([playhead.playing, playhead.frame], [false, 102]);

  playhead.seek(0.06);
  playhead.play();
  playhead.advance(0.03, always);
  assert.equal(playhead.frame, 3, "the frame on screen is one of those that were wanted");
  playhead.step(1);
  assert.equal(playhead.frame, 4, "and a step leads from what is on screen");
});

/**
 * @param {number} setting
 * @param {number} seconds
 * @param {number} frame
 * @param {Partial<Api.TimelinePoint>} rest
 * @returns {Api.TimelinePoint}
 */
const point = (setting, seconds, frame, rest) => ({
  setting,
  seconds,
  frame,
  asked: 0.5,
  patch_x: 240,
  patch_y: 120,
  ...rest,
});

/** @type {Api.Timeline} */
const TIMELINE = {
  absences: [],
  comments: [],
  pauses: [],
  set_aside: [],
  settings: [
    { setting: 1, from: 0, to: 10 },
    { setting: 2, from: 12, to: 20 },
  ],
  points: [
    point(1, 0, 1, { asked: 0.5, measured: 0.45, metric: 10 }),
    point(1, 10, 2, { asked: 0.6, measured: 0.55, metric: 20 }),
    point(2, 12, 3, { asked: 0.5, metric: 0.5 }),
    point(2, 20, 4, { asked: 0.7, metric: 0.25 }),
  ],
  sights: [],
  choices: [],
  holds: [],
  patch_stays: false,
};

test("the metric's line reaches the top in every setting", () => {
  // 100 seconds cover 1000 pixels, beginning at 44. A metric of 0 is at 88, a setting's largest metric at 8.
  const scale = new Scale(100, 1056);
  assert.equal(metricPath(TIMELINE.points, scale, 8, 88), "M44.0 48.0L144.0 8.0M164.0 8.0L244.0 48.0");
});

test("a pixel of the drawing is a moment, within the timeline", () => {
  const scale = new Scale(100, 1056);
  assert.deepEqual(
    [44, 544, 1044, 0, 9999].map((x) => scale.secondsAt(x)),
    [0, 50, 100, 0, 100],
  );
});

test("the moment on screen is told with its setting, policy and values", () => {
  assert.equal(settingAt(TIMELINE.settings, 11), null);
  assert.deepEqual(valuesAt(TIMELINE, ["fixed", "mlr-learned"], 12.5), [
    ["Setting", "2, mlr-learned"],
    ["Focal power", "0.500"],
    ["Metric", "0.5000"],
  ]);
  assert.deepEqual(valuesAt(TIMELINE, [], 11), [
    ["Setting", "none under way"],
    ["Focal power", "–"],
    ["Metric", "–"],
  ]);
  assert.equal(valuesAt(TIMELINE, [], 5)[1]?.[1], "–", "no value for so long");
  assert.deepEqual([0, 5.26, 65.2, 600, -0.5].map(momentText), [
    "0:00.0",
    "0:05.2",
    "1:05.2",
    "10:00.0",
    "−0:00.5",
  ]);
});

test("the last comment is the latest of those said by then, whatever order they were kept in", () => {
  const comments = [{ seconds: 8 }, { seconds: 3 }, { seconds: 20 }];
  assert.deepEqual(
    [2, 3, 10, 30].map((seconds) => lastComment(comments, seconds)),
    [-1, 1, 0, 2],
  );
});

test("the patch is shown where somebody chose it, from then on and in that setting alone", () => {
  const timeline = {
    ...TIMELINE,
    choices: [
      { seconds: 4, frame: 40, x: 300, y: 100 },
      { seconds: 8, frame: 80 },
    ],
    points: [
      point(1, 3.9, 39, {}),
      point(1, 4.4, 44, { patch_x: 284, patch_y: 84 }),
      point(1, 8.1, 81, {}),
      point(2, 13, 130, {}),
    ],
  };
  const patch = { x: 284, y: 84, width: 32, height: 32 };
  assert.deepEqual(
    [3.9, 4, 6, 8.1, 13].map((seconds) => chosenPatchAt(timeline, seconds)),
    [null, patch, patch, null, null],
  );
  // Where a choice stays, it counts in the next setting too; but what was not measured nearby is not shown.
  const stays = { ...timeline, patch_stays: true, choices: timeline.choices.slice(0, 1) };
  assert.deepEqual(chosenPatchAt(stays, 13), { x: 240, y: 120, width: 32, height: 32 });
  assert.equal(chosenPatchAt(stays, 19), null);
});
