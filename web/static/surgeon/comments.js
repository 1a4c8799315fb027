// The comment that is being written, and the comments that were made. A comment belongs to the setting under which it
// was begun, even if the setting changes while it is being written. A comment begun in another tab is offered, not
// shown.

import { say, words } from "../shared/language.js";
import { heldWords, isEnded } from "./words.js";

export const PATH = "/api/surgeon/comments";

/** How many characters of another tab's draft its button shows. */
const OFFERED_LETTERS = 16;

/**
 * What was on screen when a comment was made.
 *
 * @typedef {object} Place
 * @property {string} session
 * @property {string | null} segment
 * @property {number} setting
 * @property {number | null} frame
 * @property {number | null} run
 * @property {number | null} [picture_width] width of the picture, in pixels
 * @property {number | null} [pictures_per_second]
 */

/** @typedef {Omit<Place, "session">} Begun where a comment was begun */
/** @typedef {{ kind: "text" | "quick" | "withdrawal", text: string } | { kind: "mark" }} Said */

/**
 * A comment in the form that the server expects.
 *
 * @param {Said} what
 * @param {Partial<Place>} place
 */
function comment(what, place) {
  const { session, segment = null, frame = null, run = null } = place;
  const { picture_width = null, pictures_per_second = null } = place;
  return { session, segment, frame, run, picture_width, pictures_per_second, ...what };
}

/** @param {import("./drafts.js").Found} draft */
function textOf({ value }) {
  return typeof value.text === "string" ? value.text.trim() : "";
}

export class Comments {
  /** The text in the box. */
  text = "";

  /** Why the last comment was not saved; empty if it was. */
  trouble = "";

  #outbox;
  #drafts;
  #here;
  #voice;
  /** The number of each setting that was on screen, by its segment. @type {Map<string, number>} */
  #numbers = new Map();
  /** @type {import("./drafts.js").Draft | null} */
  #draft = null;
  /** @type {Begun | null} */
  #begun = null;
  #saved = 0;
  /** @type {string | null | undefined} */
  #session;
  #closed = true;

  /**
   * @param {import("./outbox.js").Outbox} outbox
   * @param {import("./drafts.js").Drafts} drafts
   * @param {() => Place | null} here null outside a session
   * @param {Pick<import("./voice_outbox.js").VoiceOutbox, "heldUp" | "isKeeping" | "durable" | "trouble">} voice
   */
  constructor(outbox, drafts, here, voice) {
    this.#outbox = outbox;
    this.#drafts = drafts;
    this.#here = here;
    this.#voice = voice;
  }

  /** @param {Api.SurgeonView | null} state */
  follow(state) {
    const session = state?.session ?? null;
    if (session !== this.#session) this.#begin(session);
    if (state?.segment != null) this.#numbers.set(state.segment, state.setting);
    this.#closed = !state || isEnded(state);
    this.#saved = state?.comments ?? 0;
  }

  /** @param {string | null} session */
  #begin(session) {
    this.#sendBox();
    this.#session = session;
    this.#sendLeft(session);

    this.#draft = session === null ? null : this.#drafts.open(`comment.${session}`);
    const left = this.#draft?.read();
    this.#begun = left?.begun ?? null;
    this.write(left?.text ?? "");
    this.trouble = "";
  }

  /** Sends the text in the box as it is, because it is about the session that is no longer shown. */
  #sendBox() {
    const text = this.text.trim();
    // If another tab took the draft over, that tab sends it.
    if (!this.#session || text === "" || !this.#draft || this.#draft.claimed) return;
    const about = { session: this.#session, ...this.#begun };
    this.#outbox.add(PATH, comment({ kind: "text", text }, about), null, this.#draft.take());
  }

  /**
   * Sends half-written comments on sessions other than `session` as they are, because their box is gone.
   *
   * @param {string | null} session
   */
  #sendLeft(session) {
    for (const left of this.#drafts.of("comment.")) {
      if (left.rest === session) continue;
      const text = textOf(left);
      const about = { session: left.rest, ...left.value.begun };
      if (text) this.#outbox.add(PATH, comment({ kind: "text", text }, about), null, left);
      this.#drafts.forget(left);
    }
  }

  /**
   * Empties the box if another tab has sent or taken over its draft.
   *
   * @param {string | null} [taken] the slot of a draft that another tab has sent or taken over
   */
  followOtherTabs(taken = null) {
    if (this.#draft && (this.#draft.isIn(taken) || this.#draft.claimed)) this.write("");
  }

  /** Whether nothing can be written: outside a session, with an empty box. */
  get disabled() {
    return this.#closed && this.text === "";
  }

  /** Whether the box holds a text. */
  get unsent() {
    return this.text.trim() !== "";
  }

  /**
   * The comment begun in another tab, whole and shortened. Null if there is none, or while something is being written
   * here.
   */
  get offer() {
    if (this.disabled || this.text !== "") return null;
    const other = this.#begunElsewhere();
    if (!other) return null;

    const whole = textOf(other);
    const letters = [...whole];
    const isLong = letters.length > OFFERED_LETTERS;
    return { whole, start: isLong ? `${letters.slice(0, OFFERED_LETTERS).join("")}…` : whole };
  }

  #begunElsewhere() {
    return this.#draft?.elsewhere().find((draft) => textOf(draft) !== "");
  }

  /** Takes over the comment begun in another tab. Returns whether there was one. */
  takeOver() {
    const other = this.#begunElsewhere();
    if (!other || !this.#draft) return false;
    this.#draft.claim(other);
    this.#begun = other.value.begun ?? null;
    this.write(other.value.text);
    return true;
  }

  /**
   * Sets the text in the box and keeps it as a draft.
   *
   * @param {string} text
   */
  write(text) {
    this.text = text;
    const here = this.#here();
    if (text === "") this.#begun = null;
    else if (!this.#begun && here) this.#begun = begunAt(here);
    this.#draft?.write(text === "" ? null : { text, begun: this.#begun });
  }

  /** Sends the text in the box. Returns the entry; null if there was nothing to send. */
  submit() {
    const here = this.#here();
    const text = this.text.trim();
    if (!here || text === "") return null;

    // The comment counts as made now, no matter when it was begun.
    const { key } = this.#draft?.take() ?? {};
    const body = comment({ kind: "text", text }, { ...here, ...this.#begun });
    const entry = this.#outbox.add(PATH, body, null, { key });
    this.write("");
    this.trouble = "";
    return entry;
  }

  /**
   * Sends a quick comment or a mark. Returns the entry; null if there is no session to which it could belong.
   *
   * @param {Said} what
   */
  say(what) {
    const here = this.#here();
    return here && this.#outbox.add(PATH, comment(what, here));
  }

  /**
   * Takes back a comment. It stays in the record, marked as taken back.
   *
   * @param {import("./outbox.js").Entry} entry
   */
  withdraw({ body }) {
    const { key, session, segment, frame, run } = body;
    this.#outbox.add(PATH, comment({ kind: "withdrawal", text: key }, { session, segment, frame, run }));
  }

  /** How many comments wait, without those that were taken back. */
  get #waiting() {
    const bodies = this.#outbox.waiting.filter(({ path }) => path === PATH).map(({ body }) => body);
    const withdrawn = new Set(bodies.filter(({ kind }) => kind === "withdrawal").map(({ text }) => text));
    return bodies.filter(({ kind, key }) => kind !== "withdrawal" && !withdrawn.has(key)).length;
  }

  /**
   * Call this when an entry of the outbox has changed.
   *
   * @param {import("./outbox.js").Change} change
   */
  hear({ entry, state, reason }) {
    if (entry.path === PATH && state === "refused") this.#refused(entry, reason ?? "");
  }

  /**
   * @param {import("./outbox.js").Entry} entry
   * @param {string} reason
   */
  #refused(entry, reason) {
    const { body } = entry;
    if (body.session !== this.#session) return;

    // A text about another setting than the one in the box stays among the refused: together they would be one comment.
    const isOther = this.text !== "" && this.#begun !== null && this.#begun.segment !== body.segment;
    if (body.kind === "text" && !isOther) {
      this.#outbox.forget(entry);
      const { segment, frame, run, picture_width, pictures_per_second } = body;
      const setting = this.#numbers.get(segment) ?? 0;
      this.#begun ??= begunAt({ segment, setting, frame, run, picture_width, pictures_per_second });
      this.write(this.text === "" ? body.text : `${body.text}\n${this.text}`);
    }
    this.trouble = refusedWords(isOther ? { ...body, kind: "quick" } : body, reason);
  }

  /**
   * The number of the setting that the comment in the box is about; null if that is the setting on screen.
   */
  get aboutOtherSetting() {
    const begun = this.#begun;
    const isOther = begun !== null && begun.setting > 0 && begun.segment !== this.#here()?.segment;
    return isOther && this.text !== "" ? begun.setting : null;
  }

  /**
   * Whether all comments are saved, with the text to show. The same line counts recordings that wait.
   *
   * @returns {{ kind: "saved" | "saving" | "unsaved", text: string }}
   */
  get status() {
    const waiting = this.#waiting;
    const recordings = this.#voice.heldUp;
    if (waiting === 0 && recordings === 0) {
      return { kind: "saved", text: this.#saved === 0 ? "" : say("comments-saved", { count: this.#saved }) };
    }

    const trouble = this.#outbox.trouble ?? this.#voice.trouble;
    const isKeeping = recordings > 0 && this.#voice.isKeeping;
    if (isKeeping || (trouble === null && recordings === 0)) return { kind: "saving", text: say("saving") };
    const durable = this.#outbox.durable && this.#voice.durable;
    return { kind: "unsaved", text: heldWords({ comments: waiting, recordings, durable, trouble }) };
  }
}

/**
 * @param {Begun} place
 * @returns {Begun}
 */
function begunAt({ segment, setting, frame, run, picture_width = null, pictures_per_second = null }) {
  return { segment, setting, frame, run, picture_width, pictures_per_second };
}

/**
 * @param {Record<string, any>} body
 * @param {string} reason
 */
function refusedWords({ kind, text }, reason) {
  if (kind === "text") return say("comment-not-saved", { reason });
  if (kind === "mark") return say("mark-not-saved", { reason });
  if (kind === "withdrawal") return say("comment-not-undone", { reason });
  return say("quick-not-saved", { text: words(text), reason });
}
