// Records from the microphone. The message of each error says what to do.

import { say } from "../shared/language.js";

/** Formats of the recording, in order of preference. The server accepts no others. */
const TYPES = ["audio/webm;codecs=opus", "audio/mp4", "audio/ogg;codecs=opus"];

/** Enough for speech that is transcribed by a person. */
const BITS_PER_SECOND = 32000;

/** A recording is delivered in pieces of this length. */
const PIECE_MS = 1000;

/** A problem with the microphone. Its message is written for people. */
export class MicrophoneTrouble extends Error {}

/**
 * Says why this page cannot record at all; empty if it can.
 *
 * @param {boolean} allowed whether the page was loaded with the right to ask for the microphone
 */
export function whyNoMicrophone(allowed) {
  if (!globalThis.isSecureContext) {
    return say("microphone-unencrypted");
  }
  if (!navigator.mediaDevices?.getUserMedia || typeof MediaRecorder === "undefined" || !recordedType()) {
    return say("microphone-unable");
  }
  return allowed ? "" : say("microphone-reload");
}

function recordedType() {
  return TYPES.find((type) => MediaRecorder.isTypeSupported(type));
}

/**
 * A recording under way.
 *
 * @typedef {object} Recording
 * @property {string} type media type, one of `TYPES`
 * @property {() => number} level how loud it is now, from 0 to 1
 * @property {() => void} stop
 */

/**
 * A recording's callbacks.
 *
 * @typedef {object} Heard
 * @property {() => void} started
 * @property {(sound: Blob) => void} piece
 * @property {() => void} lost the microphone was taken away, or the recorder failed
 * @property {() => void} stopped the recording has ended; no more pieces come
 */

/** @typedef {{ stream: MediaStream, meter: Meter }} Microphone */

/**
 * The microphone, open for as long as a session may use it: a browser may ask again at each opening, and takes a moment
 * each time. Between the recordings nothing listens to it.
 *
 * @type {Microphone | null}
 */
let opened = null;

/** An opening under way. @type {Promise<Microphone> | null} */
let opening = null;

/**
 * Opens the microphone, unless it is open. Called in a tap, it also wakes the meter, which browsers keep silent until
 * then.
 */
export async function openMicrophone() {
  const isOpen = opened?.stream.getTracks().every(({ readyState }) => readyState === "live");
  if (opened && isOpen) {
    opened.meter.wake();
    return opened;
  }
  // Whoever needs the microphone meanwhile waits for the same opening: of two, only one would be closed again.
  opening ??= openAnew().finally(() => {
    opening = null;
  });
  const microphone = await opening;
  // The tap may have come once the opening was under way.
  microphone.meter.wake();
  return microphone;
}

/** @returns {Promise<Microphone>} */
async function openAnew() {
  closeMicrophone();
  // Made in the tap itself, before anything is awaited: later the browser would no longer let it sound.
  const meter = makeMeter();
  try {
    const stream = await askForMicrophone();
    meter.listen(stream);
    opened = { stream, meter };
    return opened;
  } catch (error) {
    // A browser gives a page only a few meters.
    meter.close();
    throw error;
  }
}

/** Closes the microphone, because the session is over. */
export function closeMicrophone() {
  for (const track of opened?.stream.getTracks() ?? []) track.stop();
  opened?.meter.close();
  opened = null;
}

/** Whether the browser lets this page use the microphone without asking. */
export async function mayOpenMicrophone() {
  try {
    const name = /** @type {PermissionName} */ ("microphone");
    return (await navigator.permissions.query({ name })).state === "granted";
  } catch {
    return false;
  }
}

/**
 * Records from the microphone until it is stopped.
 *
 * @param {Heard} heard
 * @returns {Promise<Recording>}
 */
export async function record(heard) {
  const { stream, meter } = await openMicrophone();
  const type = recordedType() ?? "";

  try {
    const recorder = new MediaRecorder(stream, { mimeType: type, audioBitsPerSecond: BITS_PER_SECOND });
    recorder.onstart = heard.started;
    recorder.ondataavailable = ({ data }) => data.size > 0 && heard.piece(data);
    recorder.onerror = heard.lost;
    recorder.onstop = heard.stopped;
    for (const track of stream.getTracks()) track.onended = heard.lost;

    recorder.start(PIECE_MS);
    return {
      type,
      level: meter.level,
      stop: () => {
        if (recorder.state !== "inactive") recorder.stop();
      },
    };
  } catch {
    closeMicrophone();
    throw new MicrophoneTrouble(say("microphone-no-start"));
  }
}

async function askForMicrophone() {
  try {
    return await navigator.mediaDevices.getUserMedia({ audio: true });
  } catch (error) {
    throw new MicrophoneTrouble(refusalWords(error instanceof Error ? error.name : ""));
  }
}

/**
 * Says why the browser gave no access to the microphone.
 *
 * @param {string} name of the error
 */
export function refusalWords(name) {
  switch (name) {
    case "NotAllowedError":
    case "SecurityError":
      return say("microphone-blocked");
    case "NotFoundError":
    case "OverconstrainedError":
      return say("microphone-none");
    case "NotReadableError":
    case "AbortError":
      return say("microphone-busy");
    default:
      return say("microphone-failed-type");
  }
}

/** @typedef {{ listen: (stream: MediaStream) => void, wake: () => void, level: () => number, close: () => void }} Meter */

/**
 * Measures how loud a stream is. If that is impossible, the level is 0 and the recording continues.
 *
 * @returns {Meter}
 */
function makeMeter() {
  try {
    const context = new AudioContext();
    const analyser = context.createAnalyser();
    const samples = new Float32Array(analyser.fftSize);
    // Browsers begin with a context that stands still, unless it is woken in a tap.
    const wake = () => void context.resume().catch(() => {});
    wake();
    return {
      listen: (stream) => context.createMediaStreamSource(stream).connect(analyser),
      wake,
      level: () => {
        analyser.getFloatTimeDomainData(samples);
        return loudness(samples);
      },
      close: () => void context.close().catch(() => {}),
    };
  } catch {
    return { listen: () => {}, wake: () => {}, level: () => 0, close: () => {} };
  }
}

/** The quietest sound that the meter shows, in decibels relative to full scale. */
const QUIETEST_DB = -60;

/**
 * How loud samples from -1 to 1 are: 0 for QUIETEST_DB and below, 1 for full scale.
 *
 * @param {Float32Array} samples
 */
export function loudness(samples) {
  let sum = 0;
  for (const sample of samples) sum += sample * sample;
  const decibels = 10 * Math.log10(sum / samples.length);
  return Math.min(Math.max(1 - decibels / QUIETEST_DB, 0), 1);
}
