import assert from "node:assert/strict";
import { test } from "node:test";

import { commentWords } from "../static/researcher/timeline_words.js";
import { voiceWords } from "../static/researcher/voice.js";

const WHOLE = {
  media_type: "audio/mp4",
  seconds: 64.6,
  ended: /** @type {const} */ ("released"),
  missing: 0,
};

test("a recording says its length and what is wrong with it", () => {
  assert.equal(voiceWords(WHOLE), "1:05");
  assert.equal(voiceWords({ ...WHOLE, ended: null }), "1:05, cut off");
  assert.equal(voiceWords({ ...WHOLE, missing: 2 }), "1:05, 2 seconds are missing");
  assert.match(voiceWords({ ...WHOLE, ended: "microphone-lost" }), /microphone was taken away/);
  assert.match(voiceWords({ ...WHOLE, media_type: null }), /Nothing of the recording/);
});

test("a voice comment is shown as its transcript, also once its sound is erased", () => {
  const comment = /** @type {Api.TimelineComment} */ ({
    kind: "voice",
    note: null,
    erased: null,
    voice: WHOLE,
  });
  assert.equal(commentWords(comment, "UTC"), "Voice comment, not transcribed yet");
  assert.equal(commentWords({ ...comment, note: "it wanders" }, "UTC"), "it wanders");
  const erased = "2026-03-01T10:00:00Z";
  assert.equal(
    commentWords({ ...comment, note: "it wanders", erased }, "UTC"),
    "it wanders (sound erased on 2026-03-01)",
  );
  assert.equal(commentWords({ ...comment, erased }, "UTC"), "Erased on 2026-03-01");
  const late = "2026-03-01T23:30:00Z";
  assert.equal(commentWords({ ...comment, erased: late }, "Europe/Berlin"), "Erased on 2026-03-02");
});
