import assert from "node:assert/strict";
import { test } from "node:test";

import { lamps, warnings } from "../static/operator/device_words.js";
import { nowWords } from "../static/operator/now.js";
import { Sight } from "../static/shared/sight.js";
import { pausedWords } from "../static/surgeon/words.js";
import { VIEW } from "./around.js";

const SMALL = { width: 512, reduced: true };
const LARGE = { width: 2048, reduced: false };

test("a comment has the size of the picture and the rate of the last two seconds", () => {
  const sight = new Sight();
  assert.deepEqual(sight.at(0), { picture_width: null, pictures_per_second: null });
  for (let now = 0; now < 5000; now += 100) sight.see(LARGE, now);
  assert.deepEqual(sight.at(4950), { picture_width: 2048, pictures_per_second: 10 });
  assert.deepEqual(
    sight.at(60_000),
    { picture_width: 2048, pictures_per_second: 0 },
    "nothing comes any more",
  );
});

test("a picture counts as reduced once it has been for three seconds, and no longer at the first that is not", () => {
  const sight = new Sight();
  sight.see(SMALL, 1000);
  assert.equal(sight.isReduced(3999), false, "each link begins so");
  assert.equal(sight.isReduced(4000), true);
  sight.see(LARGE, 4100);
  assert.equal(sight.isReduced(9000), false);
  sight.see(SMALL, 9000);
  assert.equal(sight.isReduced(11_000), false);
});

/**
 * @param {Partial<Stream.TabletSign>} tablet
 * @returns {Stream.OperatorStatus}
 */
function status(tablet) {
  const device = { name: "device", working: true, simulated: false, message: "works" };
  return {
    camera: { ...device, fps: 50, lost: 0 },
    camera_offer: null,
    lens: { ...device, caution: false },
    policy: null,
    focal_power: null,
    held: null,
    message: null,
    steps_per_second: 50,
    steps: 1,
    telemetry_dropped: 0,
    latency_p50_micros: null,
    latency_p99_micros: null,
    priority: { standing: "real-time", message: "ok" },
    lock: null,
    following: null,
    certificate_until: null,
    tablet: { presence: "present", away_seconds: null, slow: false, size: null, ...tablet },
  };
}

test("the operator sees whether the surgeon’s tablet is there, and is warned during a session that it is not", () => {
  const lamp = (/** @type {Partial<Stream.TabletSign>} */ tablet) => lamps(status(tablet)).at(-1);
  const size = { width: 2048, height: 1088 };
  assert.deepEqual(lamp({ size })?.level, "");
  assert.match(lamp({ size })?.figure ?? "", /2048×1088/);
  assert.match(lamp({ size, slow: true })?.figure ?? "", /reduced/);
  assert.equal(lamp({ size, slow: true })?.level, "warn");
  assert.equal(lamp({ presence: "silent", away_seconds: 4 })?.level, "bad");
  assert.equal(lamp({ presence: "hidden", away_seconds: 4 })?.level, "bad");

  const away = status({ presence: "silent", away_seconds: 4 });
  assert.match(warnings(away, true)[0]?.text ?? "", /tablet has not answered for 4 s/);
  assert.deepEqual(warnings(away, false), [], "before a session the tablet may be anywhere");
  assert.match(
    warnings(status({ presence: "hidden", away_seconds: 9 }), true)[0]?.text ?? "",
    /not on screen/,
  );
  assert.deepEqual(warnings(status({}), true), []);
});

test("a focus that people hold or pause is no trouble, and one that the loop holds is", () => {
  const loop = (/** @type {Stream.OperatorStatus["held"]} */ held) => {
    const now = { ...status({}), held, message: "the focus is held" };
    return {
      lamp: lamps(now).find(({ name }) => name === "focus loop")?.level,
      warnings: warnings(now, true).length,
    };
  };
  for (const held of /** @type {const} */ (["paused", "focus-held"])) {
    assert.deepEqual(loop(held), { lamp: "", warnings: 0 }, held);
  }
  assert.deepEqual(loop("policy-slow"), { lamp: "bad", warnings: 1 });
});

test("while the tablet is away, the line does not say that the surgeon is looking", () => {
  const facts = { known: true, missed: false, heardAt: null, refused: false, working: true, wrong: false };
  /** @type {Api.OperatorView} */
  const view = {
    ...VIEW,
    participant: "S-01",
    protocol: "p",
    log: [],
    latest_comments: [],
    may_focus_by_hand: false,
    withdrawn: false,
  };
  assert.match(nowWords({ ...facts, view, away: false }), /surgeon is looking/);
  assert.match(nowWords({ ...facts, view, away: true }), /tablet is away/);
});

test("the surgeon reads what paused the session", () => {
  const words = (/** @type {Api.SurgeonView["paused_by"]} */ by) =>
    pausedWords({ ...VIEW, paused: true, paused_by: by }, "All saved.");
  assert.match(words("operator"), /operator has paused/);
  assert.match(words("surgeon"), /You have paused/);
  assert.match(words("restart"), /server was restarted/);
  assert.match(words("tablet-away"), /tablet was away/);
  assert.match(words("small-picture"), /picture was too small/);
});
