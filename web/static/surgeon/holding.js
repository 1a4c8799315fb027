// Tells the server how much of what was said in a session this device still holds, so that nobody unblinds it over that
// unasked: once when a session is first shown, and from its end on whenever that changes.

import { post, Refused } from "../shared/api.js";
import { draftsOf } from "./drafts.js";
import { device } from "./origin.js";

const PATH = "/api/surgeon/holding";
const TRY_AGAIN_MS = 5000;
const UNDER_WAY = "under way";

/** A session that the server does not know is nobody's business. */
function unlessFinal(error) {
  if (!(error instanceof Refused && error.final)) throw error;
}

/** `unsent()` is whether the comment box holds a text. */
export function holdingTeller(outbox, unsent) {
  /** What the server knows, by session. */
  const known = new Map();
  const sessions = new Set(outbox.sessions);
  let shown = null;
  let telling = false;
  let timer = null;

  function follow(state) {
    shown = state;
    if (state) sessions.add(state.session);
    tell();
  }

  /** Entries and half-written texts; an order of settings that was not confirmed is no answer. */
  function held(session) {
    const comments = draftsOf(`comment.${session}`).map(({ value }) => value.text);
    const answers = draftsOf(`answer.${session}/`).map(({ value }) => value);
    const written = [...comments, ...answers].filter((text) => typeof text === "string" && text.trim() !== "").length;
    const inBox = shown?.session === session && unsent() && written === 0 ? 1 : 0;
    return outbox.held(session) + written + inBox;
  }

  const underWay = (session) => shown?.session === session && !/completed|aborted/.test(shown.phase);

  /** What the server does not know yet, or null. */
  function news() {
    for (const session of outbox.sessions) sessions.add(session);
    for (const session of sessions) {
      if (underWay(session) && known.get(session) === UNDER_WAY) continue;
      const holding = held(session);
      const word = underWay(session) ? UNDER_WAY : `holds ${holding}`;
      if (known.get(session) !== word) return { session, holding, word };
    }
    return null;
  }

  async function tell() {
    if (telling) return;
    telling = true;
    clearTimeout(timer);
    try {
      for (let next = news(); next; next = news()) {
        const { session, holding, word } = next;
        await post(PATH, { session, device: device(), holding }).catch(unlessFinal);
        known.set(session, word);
      }
    } catch {
      timer = setTimeout(tell, TRY_AGAIN_MS);
    }
    telling = false;
  }

  outbox.addEventListener("change", tell);
  return { follow, tell };
}
