import assert from "node:assert/strict";
import { test } from "node:test";

import { Framing } from "../static/shared/framing.js";
import { Gestures } from "../static/shared/gestures.js";
import { Hold, isHoldKey } from "../static/shared/hold.js";
import { Pointing } from "../static/shared/pointing.js";
import { settle } from "./around.js";

/** What came with a picture whose patch has its middle at `x`, `y`. */
function header(x = 256, y = 136, choices = 0) {
  const patch = { x: x - 16, y: y - 16, width: 32, height: 32 };
  const pointed = x !== 256 || y !== 136;
  return /** @type {Stream.Header} */ (
    /** @type {unknown} */ ({ frame: 7, width: 1024, height: 544, per_cell: 2, patch, pointed, choices })
  );
}

/** Pointing with a clock of its own, and what it has done. */
function pointing() {
  const done = {
    /** @type {unknown[]} */ sent: [],
    /** @type {unknown[]} */ reported: [],
    now: 0,
    why: "",
    /** @type {Error | null} */ refusal: null,
    /** @type {{ at: number, run: () => void }[]} */ timers: [],
    /** @param {number} ms */
    wait(ms) {
      done.now += ms;
      const due = done.timers.filter(({ at }) => at <= done.now);
      done.timers = done.timers.filter(({ at }) => at > done.now);
      for (const { run } of due) run();
    },
  };
  const made = new Pointing({
    send: async (frame, at) => {
      done.sent.push([frame, at]);
      if (done.refusal) throw done.refusal;
    },
    later: (run, ms) => {
      const timer = { at: done.now + ms, run };
      done.timers.push(timer);
      return () => {
        done.timers = done.timers.filter((other) => other !== timer);
      };
    },
    now: () => done.now,
    changed: () => {},
    report: (trouble) => done.reported.push(trouble),
    whyNot: () => done.why,
  });
  made.allowed = true;
  made.see(header());
  return { made, done };
}

test("a tap has its ring at once and is sent before 300 ms have passed", () => {
  const { made, done } = pointing();
  made.tap({ x: 300, y: 90 });
  assert.deepEqual([made.ring?.x, made.ring?.y, done.sent], [300, 90, []]);
  done.wait(299);
  assert.deepEqual(done.sent, [[7, { x: 300, y: 90 }]]);
  done.wait(2000);
  assert.equal(made.ring, null);
});

test("a double tap or a pinch sends nothing and takes the ring back", () => {
  for (const second of ["tap", "finger"]) {
    const { made, done } = pointing();
    const framing = new Framing();
    const gestures = new Gestures(framing, {
      tap: (point) => made.tap(point),
      takeBack: () => made.takeBack(),
    });
    gestures.down(1, { x: 50, y: 50 }, 0);
    gestures.up(1, { x: 50, y: 50 }, 40);
    assert.notEqual(made.ring, null);
    gestures.down(1, { x: 52, y: 50 }, 180);
    if (second === "tap") gestures.up(1, { x: 52, y: 50 }, 220);
    else gestures.down(2, { x: 90, y: 90 }, 200);
    assert.equal(made.ring, null, second);
    done.wait(1000);
    assert.deepEqual(done.sent, [], second);
  }
});

test("the other half of a double tap on what lay over the picture points at nothing", () => {
  const { made, done } = pointing();
  made.uncover();
  done.wait(200);
  made.tap({ x: 300, y: 90 });
  done.wait(400);
  assert.deepEqual([made.ring, done.sent], [null, []]);

  made.tap({ x: 300, y: 90 });
  done.wait(300);
  assert.deepEqual(done.sent, [[7, { x: 300, y: 90 }]]);
});

test("a drag and a long press are no taps", () => {
  const { made, done } = pointing();
  const taps = { tap: (/** @type {any} */ point) => made.tap(point), takeBack: () => made.takeBack() };
  const gestures = new Gestures(new Framing(), taps);
  gestures.down(1, { x: 50, y: 50 }, 0);
  gestures.move(1, { x: 90, y: 50 });
  gestures.up(1, { x: 90, y: 50 }, 100);
  gestures.down(1, { x: 50, y: 50 }, 1000);
  gestures.up(1, { x: 50, y: 50 }, 1600);
  done.wait(1000);
  assert.deepEqual(done.sent, []);
});

test("who did not point sees the ring too, but not when the patch was merely set back", () => {
  const { made } = pointing();
  made.see(header(300, 100, 1));
  assert.deepEqual([made.ring?.x, made.ring?.y, made.isPointed], [300, 100, true]);
  const { made: other } = pointing();
  other.see(header(300, 100, 0));
  assert.equal(other.ring, null);
});

test("a picture that is not live, a place beside it and a page that may not point send nothing", () => {
  const { made, done } = pointing();
  done.why = "not live";
  made.tap({ x: 300, y: 90 });
  made.centre();
  assert.deepEqual([made.ring, done.reported], [null, ["not live", "not live"]]);
  done.why = "";
  for (const at of [
    { x: -1, y: 5 },
    { x: 5, y: 273 },
  ])
    made.tap(at);
  made.allowed = false;
  made.tap({ x: 300, y: 90 });
  made.nudge(1, 0);
  made.centre();
  done.wait(1000);
  assert.deepEqual([done.sent, made.ring], [[], null]);
});

test("a refusal takes the ring back and is reported", async () => {
  const { made, done } = pointing();
  done.refusal = new Error("the session is paused");
  made.tap({ x: 300, y: 90 });
  done.wait(300);
  await Promise.resolve();
  await Promise.resolve();
  assert.deepEqual([made.ring, done.reported], [null, [done.refusal]]);
});

test("keys move the place step by step, and only where they end is sent", () => {
  const { made, done } = pointing();
  for (let step = 0; step < 3; step += 1) made.nudge(1, 0);
  made.nudge(0, -1);
  done.wait(300);
  const [[frame, at]] = /** @type {[[number, { x: number, y: number }]]} */ (done.sent);
  assert.deepEqual([frame, Math.round(at.x), Math.round(at.y)], [7, 290, 125]);
  made.centre();
  assert.deepEqual(done.sent[1], [7, null]);
});

test("the focus is held by a short press until the next one, or as long as a long press lasts", async () => {
  let now = 0;
  /** @type {boolean[]} */
  const asked = [];
  const hold = new Hold({ ask: async (held) => void asked.push(held), now: () => now });
  const press = (/** @type {number} */ ms) => {
    hold.press("pedal");
    hold.press("pedal");
    now += ms;
    return hold.release("pedal");
  };

  press(200);
  await settle();
  assert.deepEqual(asked, [true]);
  press(200);
  await settle();
  assert.deepEqual(asked, [true, false]);
  press(900);
  await settle();
  assert.deepEqual(asked, [true, false, true, false]);
  // A second finger changes nothing.
  hold.press("finger");
  assert.equal(hold.release("pedal"), false);
  hold.leave();
  await settle();
  assert.deepEqual(asked.slice(4), [true]);
});

test("a release is sent only when its hold is answered, so that it cannot overtake it", async () => {
  /** @type {boolean[]} */
  const asked = [];
  let answer = () => {};
  const ask = (/** @type {boolean} */ held) => {
    asked.push(held);
    return new Promise((/** @type {(value: void) => void} */ resolve) => {
      answer = resolve;
    });
  };
  let now = 0;
  const hold = new Hold({ ask, now: () => now });
  hold.press("finger");
  now = 900;
  hold.release("finger");
  await settle();
  assert.deepEqual(asked, [true]);
  answer();
  await settle();
  assert.deepEqual(asked, [true, false]);
});

test("a word of the server from before a hold does not keep its release from being sent", async () => {
  /** @type {boolean[]} */
  const asked = [];
  /** @type {(() => void)[]} */
  const answers = [];
  const ask = (/** @type {boolean} */ held) => {
    asked.push(held);
    return new Promise((/** @type {(value: void) => void} */ resolve) => answers.push(resolve));
  };
  let now = 0;
  const hold = new Hold({ ask, now: () => now });
  hold.press("finger");
  await settle();
  hold.follow(false);
  now = 900;
  hold.release("finger");
  answers.shift()?.();
  await settle();
  assert.deepEqual(asked, [true, false]);

  // Once all is answered, the server's last word counts: somebody else may hold the focus.
  hold.follow(true);
  answers.shift()?.();
  await settle();
  assert.ok(hold.held);
});

test("a pedal's keys hold the focus, and fields keep those that they use", () => {
  assert.ok(isHoldKey({ key: "F24" }, true) && isHoldKey({ key: "PageUp" }, false));
  assert.ok(!isHoldKey({ key: "PageUp" }, true) && !isHoldKey({ key: "F13" }, false));
  assert.ok(!isHoldKey({ key: "F24", ctrlKey: true }, false));
});
