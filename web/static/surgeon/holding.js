// Tells the server how many comments and answers of a session this device still holds, so that nobody unblinds the
// session without knowing. It does so once when a session is first shown, and from the session's end on whenever the
// number changes.

import { Refused } from "../shared/api.js";
import { isEnded } from "./words.js";

const TRY_AGAIN_MS = 5000;
const UNDER_WAY = "under way";

/** @typedef {Api.SurgeonView | null} View */

/**
 * Throws `error` unless it is a final refusal. The server needs no message about a session that it does not know.
 *
 * @param {unknown} error
 */
function unlessFinal(error) {
  if (!(error instanceof Refused && error.final)) throw error;
}

export class Holding {
  #outbox;
  #voice;
  #drafts;
  #unsent;
  #post;
  #later;
  /** The message last sent to the server, by session. @type {Map<string, string>} */
  #known = new Map();
  #sessions;
  /** @type {View} */
  #shown = null;
  #telling = false;
  #cancel = () => {};

  /**
   * @param {object} around
   * @param {import("./outbox.js").Outbox} around.outbox
   * @param {Pick<import("./voice_outbox.js").VoiceOutbox, "held" | "sessions" | "subscribe">} around.voice
   * @param {import("./drafts.js").Drafts} around.drafts
   * @param {() => boolean} around.unsent whether the comment box holds a text
   * @param {(session: string, holding: number) => Promise<unknown>} around.post
   * @param {(run: () => void, ms: number) => () => void} around.later
   */
  constructor({ outbox, voice, drafts, unsent, post, later }) {
    this.#outbox = outbox;
    this.#voice = voice;
    this.#drafts = drafts;
    this.#unsent = unsent;
    this.#post = post;
    this.#later = later;
    this.#sessions = new Set(outbox.sessions);
    outbox.subscribe(() => this.tell());
    voice.subscribe(() => this.tell());
  }

  /** @param {View} state */
  follow(state) {
    this.#shown = state;
    if (state) this.#sessions.add(state.session);
    this.tell();
  }

  /**
   * Tells the server about a session that this page does not show, even if the device holds nothing of it.
   *
   * @param {string | null} session
   */
  tellOf(session) {
    if (session !== null) this.#sessions.add(session);
    this.tell();
  }

  /**
   * The number of unsent entries and half-written texts. A ranking of settings that was not confirmed does not count.
   *
   * @param {string} session
   */
  #held(session) {
    const comments = this.#drafts.of(`comment.${session}`).map(({ value }) => value.text);
    const answers = this.#drafts.of(`answer.${session}/`).map(({ value }) => value);
    const written = [...comments, ...answers].filter(
      (text) => typeof text === "string" && text.trim() !== "",
    );

    const onlyInBox = this.#shown?.session === session && this.#unsent() && written.length === 0;
    const held = this.#outbox.held(session) + this.#voice.held(session);
    return held + written.length + (onlyInBox ? 1 : 0);
  }

  /** @param {string} session */
  #underWay(session) {
    const shown = this.#shown;
    return shown?.session === session && !isEnded(shown);
  }

  /** The next thing that the server does not know yet, or null. */
  #news() {
    for (const session of this.#outbox.sessions) this.#sessions.add(session);
    for (const session of this.#voice.sessions) this.#sessions.add(session);

    for (const session of this.#sessions) {
      if (this.#underWay(session) && this.#known.get(session) === UNDER_WAY) continue;
      const holding = this.#held(session);
      const word = this.#underWay(session) ? UNDER_WAY : `holds ${holding}`;
      if (this.#known.get(session) !== word) return { session, holding, word };
    }
    return null;
  }

  async tell() {
    if (this.#telling) return;
    this.#telling = true;
    this.#cancel();
    try {
      for (let next = this.#news(); next; next = this.#news()) {
        await this.#post(next.session, next.holding).catch(unlessFinal);
        this.#known.set(next.session, next.word);
      }
    } catch {
      this.#cancel = this.#later(() => this.tell(), TRY_AGAIN_MS);
    }
    this.#telling = false;
  }
}
