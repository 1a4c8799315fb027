// Hold to talk: from the press to the end of the recording. Does not deal with buttons and keys.

import { say } from "../shared/language.js";
import { clockText } from "../shared/text.js";
import { MicrophoneTrouble } from "./microphone.js";

/** A recording ends by itself after this time, because a pedal may be held by mistake. */
export const LIMIT_MS = 120_000;

/** The surgeon is warned this long before the limit. */
const TOLD_MS = 15_000;

/** @typedef {import("./comments.js").Place} Place */
/** @typedef {import("./voice_outbox.js").Ending} Ending */

/**
 * @typedef {object} Surroundings
 * @property {import("./voice_outbox.js").VoiceOutbox} outbox
 * @property {(heard: import("./microphone.js").Heard) => Promise<import("./microphone.js").Recording>} record
 * @property {() => Place | null} here what is on screen now; null outside a session
 * @property {() => import("./origin.js").Stamp} stamp
 * @property {() => number} now milliseconds by the page's clock
 * @property {(run: () => void, ms: number) => () => void} later returns a function that cancels the call
 * @property {() => void} changed
 */

/**
 * A press that has not ended yet.
 *
 * @typedef {object} Held
 * @property {Place} place
 * @property {import("./origin.js").Stamp} given
 * @property {boolean} released
 * @property {import("./microphone.js").Recording | null} recording
 * @property {string | null} comment the comment's key; null until the recording begins
 * @property {number} began when the recording began, by the page's clock
 * @property {number} pieces
 * @property {Ending | null} ending
 * @property {Promise<void>} pieced resolves once all pieces so far are in the outbox
 * @property {() => void} cancel cancels the time limit
 */

export class Talk {
  /** A sentence that says what went wrong or what to do differently; empty if all is well. */
  trouble = "";

  #around;
  /** @type {Held | null} */
  #held = null;

  /** @param {Surroundings} around */
  constructor(around) {
    this.#around = around;
  }

  /** @returns {"idle" | "opening" | "recording"} */
  get state() {
    if (this.#held === null) return "idle";
    return this.#held.comment === null ? "opening" : "recording";
  }

  /** How loud it is now, from 0 to 1. */
  get level() {
    return this.#held?.recording?.level() ?? 0;
  }

  /** The button's label. */
  get label() {
    const held = this.#held;
    if (held === null) return say("hold-to-talk");
    if (held.comment === null) return say("talk-wait");

    const gone = this.#around.now() - held.began;
    const left = LIMIT_MS - gone;
    if (left <= TOLD_MS) return say("talk-ends", { seconds: Math.max(1, Math.ceil(left / 1000)) });
    return say("talk-recording", { time: clockText(gone / 1000) });
  }

  /** The surgeon presses. Returns whether a recording is begun. */
  press() {
    const place = this.#around.here();
    if (this.#held !== null || place === null) return false;

    this.trouble = "";
    /** @type {Held} */
    const held = {
      place,
      given: this.#around.stamp(),
      released: false,
      recording: null,
      comment: null,
      began: 0,
      pieces: 0,
      ending: null,
      pieced: Promise.resolve(),
      cancel: () => {},
    };
    this.#held = held;
    this.#around.changed();
    this.#open(held);
    return true;
  }

  /**
   * The surgeon releases the button, or the page can no longer notice whether it is held.
   *
   * @param {Ending} [ending]
   */
  release(ending = "released") {
    const held = this.#held;
    if (held === null) return;
    held.released = true;
    if (held.recording) this.#end(held, ending);
  }

  /** @param {Held} held */
  async #open(held) {
    try {
      held.recording = await this.#around.record({
        started: () => this.#began(held),
        piece: (sound) => this.#piece(held, sound),
        lost: () => this.#lost(held),
        stopped: () => this.#stopped(held),
      });
    } catch (error) {
      this.trouble = error instanceof MicrophoneTrouble ? error.message : say("microphone-failed");
      this.#close(held);
      return;
    }
    // The button was released before the microphone was open, for example while the browser asked for permission.
    if (held.released) this.#end(held, "released");
  }

  /** @param {Held} held */
  #began(held) {
    if (held.comment !== null || held.released) return;
    held.began = this.#around.now();
    held.comment = this.#around.outbox.begin(held.place, held.given);
    held.cancel = this.#around.later(() => this.#end(held, "limit"), LIMIT_MS);
    this.#around.changed();
  }

  /**
   * @param {Held} held
   * @param {Blob} sound
   */
  #piece(held, sound) {
    const { comment } = held;
    // The button was released before the recording began, so nothing is recorded.
    if (comment === null) return;
    held.pieces += 1;
    const piece = held.pieces;
    const through_ms = Math.round(this.#around.now() - held.began);
    held.pieced = held.pieced.then(async () => {
      try {
        this.#add(held, comment, piece, through_ms, await sound.arrayBuffer());
      } catch {
        // The browser cannot give this piece back, for want of room say. The pieces before and after it still count.
        this.#lost(held);
        this.#around.changed();
      }
    });
  }

  /**
   * @param {Held} held
   * @param {string} comment
   * @param {number} piece
   * @param {number} through_ms
   * @param {ArrayBuffer} audio
   * @param {Ending | null} [ended]
   */
  #add(held, comment, piece, through_ms, audio, ended = null) {
    const { session } = held.place;
    const type = held.recording?.type ?? "";
    this.#around.outbox.add({ comment, session, piece, type, through_ms, ended, audio });
  }

  /** @param {Held} held */
  #lost(held) {
    if (held.ending !== null) return;
    this.trouble = say("talk-lost");
    this.#end(held, "microphone-lost");
  }

  /**
   * @param {Held} held
   * @param {Ending} ending
   */
  #end(held, ending) {
    if (held.ending !== null) return;
    held.ending = ending;
    held.cancel();
    if (ending === "limit") {
      this.trouble = say("talk-limit");
    }
    if (ending === "left" && held.comment !== null) {
      this.trouble = say("talk-left");
    }
    if (held.comment === null) this.trouble ||= say("talk-nothing");
    held.recording?.stop();
  }

  /** @param {Held} held */
  #stopped(held) {
    // The browser may end a recording by itself.
    this.#lost(held);
    const { comment, ending } = held;
    const piece = held.pieces + 1;
    const through_ms = Math.round(this.#around.now() - held.began);
    held.pieced = held.pieced.then(() => {
      if (comment !== null && ending !== null) {
        this.#add(held, comment, piece, through_ms, new ArrayBuffer(0), ending);
      }
      // Only now: who reads that the recording is over may close the page.
      this.#close(held);
    });
  }

  /** @param {Held} held */
  #close(held) {
    held.cancel();
    if (this.#held === held) this.#held = null;
    this.#around.changed();
  }
}
