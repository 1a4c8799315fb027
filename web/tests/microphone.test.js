// The microphone of the surgeon's tablet: opened once, and closed again.

import assert from "node:assert/strict";
import { test } from "node:test";

import { closeMicrophone, MicrophoneTrouble, openMicrophone } from "../static/surgeon/microphone.js";

/** A tablet whose browser answers as the test says. Counts what listens and what measures. */
function fakeTablet() {
  const tablet = { asked: 0, listening: 0, meters: 0, refuses: false };

  const getUserMedia = async () => {
    tablet.asked += 1;
    if (tablet.refuses) throw Object.assign(new Error("no"), { name: "NotAllowedError" });
    const track = {
      readyState: "live",
      stop() {
        track.readyState = "ended";
        tablet.listening -= 1;
      },
    };
    tablet.listening += 1;
    return { getTracks: () => [track] };
  };

  class Meter {
    constructor() {
      tablet.meters += 1;
    }
    createAnalyser = () => ({ fftSize: 32 });
    createMediaStreamSource = () => ({ connect() {} });
    resume = async () => {};
    close = async () => {
      tablet.meters -= 1;
    };
  }

  Object.defineProperty(globalThis, "navigator", {
    configurable: true,
    value: { mediaDevices: { getUserMedia } },
  });
  Object.defineProperty(globalThis, "AudioContext", { configurable: true, value: Meter });
  return tablet;
}

test("who opens the microphone while it is being opened gets the same one, and one closing ends it", async () => {
  const tablet = fakeTablet();
  const [first, second] = await Promise.all([openMicrophone(), openMicrophone()]);
  assert.equal(first, second);
  assert.equal(await openMicrophone(), first, "it stays open from recording to recording");
  assert.equal(tablet.asked, 1);

  closeMicrophone();
  assert.deepEqual([tablet.listening, tablet.meters], [0, 0]);
});

test("a microphone that is refused leaves nothing open, and can be asked for again", async () => {
  const tablet = fakeTablet();
  tablet.refuses = true;
  await assert.rejects(openMicrophone(), MicrophoneTrouble);
  assert.deepEqual([tablet.listening, tablet.meters], [0, 0]);

  tablet.refuses = false;
  await openMicrophone();
  assert.equal(tablet.listening, 1);
  closeMicrophone();
});
