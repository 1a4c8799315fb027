// Keeps voice recordings until the server has them. A recording is a sequence of steps: one that begins its comment,
// and then one piece per second. Each step is first kept on this device, and sent while the surgeon still speaks. The
// comment's key and the piece's number make sending a step twice harmless. What the server refuses stays on this
// device, and is tried again when the page is next opened.

import { inWords, Refused } from "../shared/api.js";
import { say } from "../shared/language.js";
import { PATH as COMMENTS } from "./comments.js";
import { Delivery } from "./delivery.js";
import { READ_AGAIN_MS } from "./disk_store.js";

/** @typedef {import("./origin.js").Stamp} Stamp */
/** @typedef {"released" | "limit" | "microphone-lost" | "left"} Ending */

/**
 * The first step of a recording: its comment, with the place and the moment of the press.
 *
 * @typedef {object} Begin
 * @property {"begin"} kind
 * @property {string} id sorts in the order of entry
 * @property {string} comment
 * @property {string} session
 * @property {Record<string, unknown>} body
 * @property {Stamp} given
 */

/**
 * A piece of a recording. The last piece is empty and says why the recording ended.
 *
 * @typedef {object} Piece
 * @property {"piece"} kind
 * @property {string} id
 * @property {string} comment
 * @property {string} session
 * @property {number} piece
 * @property {string} type
 * @property {number} through_ms
 * @property {Ending | null} ended
 * @property {ArrayBuffer} audio
 */

/** @typedef {Begin | Piece} Step */

/**
 * @typedef {object} Surroundings
 * @property {import("./disk_store.js").DiskStore<Step>} store
 * @property {import("./origin.js").Origins} origins
 * @property {(path: string, body: unknown) => Promise<void>} send sends JSON; resolves once the server has saved it
 * @property {(path: string, audio: ArrayBuffer, type: string) => Promise<void>} sendAudio
 * @property {() => string} newId
 * @property {() => number} wall milliseconds since 1970
 * @property {(run: () => void, ms: number) => () => void} later returns a function that cancels the call
 */

export class VoiceOutbox {
  /** Why the last attempt to send failed; null if it succeeded. @type {string | null} */
  trouble = null;

  /** Resolves once the steps that an earlier load of the page left are loaded. @type {Promise<void>} */
  ready;

  #around;
  /** The steps that are not saved yet, by id. @type {Map<string, Step>} */
  #steps = new Map();
  /** Why the server refused a recording, by comment. @type {Map<string, string>} */
  #refused = new Map();
  /** The steps that are on their way to this device's disk, by id. @type {Set<string>} */
  #keeping = new Set();
  /** The steps that this device does not keep over a reload, by id. @type {Set<string>} */
  #unkept = new Set();
  /** @type {Set<() => void>} */
  #listeners = new Set();
  /** @type {Delivery<Step>} */
  #delivery;
  #latest = 0;
  #cancelReading = () => {};
  /** Ids of the steps that this page has sent. @type {Set<string>} */
  #done = new Set();
  /** Whether the last step that was sent ended a recording. */
  #hasSaved = false;

  /** @param {Surroundings} around */
  constructor(around) {
    this.#around = around;
    const send = (/** @type {Step} */ step) => this.#send(step);
    this.#delivery = new Delivery({ waiting: () => this.#queue(), send, later: around.later });
    this.ready = this.#load();
  }

  async #load() {
    const left = await this.#around.store.all();
    this.#cancelReading();
    if (left === null) {
      const again = () => {
        this.ready = this.#load();
      };
      this.#cancelReading = this.#around.later(again, READ_AGAIN_MS);
      return;
    }

    for (const step of left) {
      // It may have been sent while the store was read.
      if (this.#done.has(step.id)) continue;
      this.#steps.set(step.id, step);
      this.#latest = Math.max(this.#latest, Number.parseInt(step.id, 10) || 0);
    }
    this.#tell();
    this.nudge();
  }

  /** Sends what this device keeps, also what a tab has left that was closed meanwhile. Each step is saved only once. */
  wake() {
    this.nudge();
    this.ready = this.#load();
  }

  /**
   * Calls `listener` whenever something has changed. Returns a function that ends the subscription.
   *
   * @param {() => void} listener
   */
  subscribe(listener) {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  }

  /** Whether this device keeps every unsaved step over a reload. */
  get durable() {
    return this.#unkept.size === 0;
  }

  /**
   * Whether this device's disk still lacks something that was said. The second that is being spoken does not count: a
   * piece is on its way each second.
   */
  get isKeeping() {
    const steps = [...this.#keeping].flatMap((id) => this.#steps.get(id) ?? []);
    return steps.length > 1 || steps.some((step) => step.kind === "begin" || step.ended !== null);
  }

  /** How many recordings are not saved yet, without those that the server refused. */
  get waiting() {
    return recordings(this.#queue());
  }

  /** The sessions that recordings on this page belong to. @returns {Set<string>} */
  get sessions() {
    return new Set([...this.#steps.values()].map(({ session }) => session));
  }

  /**
   * How many recordings of a session this device holds because they are not saved yet or were refused.
   *
   * @param {string} session
   */
  held(session) {
    return recordings([...this.#steps.values()].filter((step) => step.session === session));
  }

  /**
   * How many recordings the server refused.
   *
   * @param {string} [session] only those of this session
   */
  refused(session) {
    const refused = [...this.#steps.values()].filter(({ comment }) => this.#refused.has(comment));
    return recordings(refused.filter((step) => session === undefined || step.session === session));
  }

  /**
   * Begins a recording. Returns its comment's key.
   *
   * @param {import("./comments.js").Place} place
   * @param {Stamp} given when the surgeon began to speak
   */
  begin({ session, segment, frame, run, picture_width = null, pictures_per_second = null }, given) {
    const comment = this.#around.newId();
    const seen = { picture_width, pictures_per_second };
    const body = { key: comment, session, segment, frame, run, ...seen, kind: "voice" };
    this.#add({ kind: "begin", id: this.#nextId(), comment, session, body, given });
    return comment;
  }

  /**
   * Adds a piece of a recording.
   *
   * @param {Omit<Piece, "kind" | "id">} piece
   */
  add(piece) {
    this.#add({ ...piece, kind: "piece", id: this.#nextId() });
  }

  /** Tries to send now, without waiting any longer. */
  nudge() {
    this.#delivery.nudge();
  }

  /** How many recordings wait because they could not be sent, or because this device cannot keep them. */
  get heldUp() {
    return this.trouble === null && this.durable ? 0 : this.waiting;
  }

  /**
   * Whether all recordings are saved, with the text to show. Recordings that are held up are counted with the comments.
   *
   * @returns {{ kind: "" | "saving" | "saved" | "unsaved", text: string }}
   */
  get status() {
    const refusal = [...this.#refused.values()].at(-1);
    if (refusal !== undefined) {
      const text = say("recordings-refused", { count: this.#refused.size, reason: refusal });
      return { kind: "unsaved", text };
    }

    if (this.heldUp > 0) return { kind: "", text: "" };
    if (this.waiting > 0) return { kind: "saving", text: say("saving-recording") };
    return this.#hasSaved ? { kind: "saved", text: say("recording-saved") } : { kind: "", text: "" };
  }

  #nextId() {
    // If the clock is set back, later steps must still sort after earlier ones.
    this.#latest = Math.max(this.#around.wall(), this.#latest + 1);
    return `${String(this.#latest).padStart(15, "0")}-${this.#around.newId()}`;
  }

  /** @param {Step} step */
  #add(step) {
    this.#steps.set(step.id, step);
    this.#keep(step);
    this.#tell();
    if (!this.#delivery.isSending) this.nudge();
  }

  /** @param {Step} step */
  async #keep(step) {
    this.#keeping.add(step.id);
    const kept = await this.#around.store.put(step);
    this.#keeping.delete(step.id);
    if (!this.#steps.has(step.id)) {
      // The server has saved the step meanwhile.
      await this.#around.store.remove(step.id);
      return;
    }
    if (!kept) this.#unkept.add(step.id);
    this.#tell();
  }

  /** The steps that are to be sent, in order. */
  #queue() {
    const open = [...this.#steps.values()].filter(({ comment }) => !this.#refused.has(comment));
    return open.sort((a, b) => (a.id < b.id ? -1 : 1));
  }

  /**
   * Sends one step. Returns whether the next step is worth trying.
   *
   * @param {Step} step
   */
  async #send(step) {
    try {
      await this.#post(step);
    } catch (error) {
      return this.#failed(step, error);
    }

    this.trouble = null;
    this.#delivery.hurry();
    this.#hasSaved = step.kind === "piece" && step.ended !== null;
    this.#done.add(step.id);
    this.#steps.delete(step.id);
    this.#unkept.delete(step.id);
    await this.#around.store.remove(step.id);
    this.#tell();
    return true;
  }

  /** @param {Step} step */
  #post(step) {
    const { send, sendAudio, origins } = this.#around;
    if (step.kind === "begin") return send(COMMENTS, { ...step.body, ...origins.tell(step.given) });

    const { comment, session, piece, through_ms, ended, audio, type } = step;
    const query = new URLSearchParams({ session, through_ms: String(through_ms) });
    if (ended) query.set("ended", ended);
    return sendAudio(`/api/surgeon/voice/${comment}/${piece}?${query}`, audio, type);
  }

  /**
   * @param {Step} step
   * @param {unknown} error
   */
  #failed(step, error) {
    if (error instanceof Refused && error.final) {
      this.#refused.set(step.comment, error.message);
      this.#tell();
      return true;
    }
    this.trouble = inWords(error, say("no-connection"));
    this.#tell();
    return false;
  }

  #tell() {
    for (const listener of [...this.#listeners]) listener();
  }
}

/**
 * The number of recordings that `steps` belong to.
 *
 * @param {Step[]} steps
 */
function recordings(steps) {
  return new Set(steps.map(({ comment }) => comment)).size;
}
