// One line that says what the operator can do now. It is derived from what the page shows anyway, so it is the same for
// every policy.

import { minuteText } from "../shared/text.js";
import { isOver, isUnderWay, lacksConsent } from "./session_words.js";

/** @typedef {Api.OperatorView} View */

/**
 * The facts from which the line is derived.
 *
 * @typedef {object} Facts
 * @property {View | null} view
 * @property {boolean} known whether it is known which session, if any, is under way
 * @property {boolean} missed whether the server has been silent for too long
 * @property {number | null} heardAt when it was last heard, in milliseconds since 1970
 * @property {boolean} refused whether the server's certificate has ended, so that the browser refuses it
 * @property {boolean} [signedOut] whether the server is silent because nobody is signed in any more
 * @property {boolean} working whether camera and lens work, as far as is known
 * @property {boolean} wrong whether the checks found something to put right before a trial
 * @property {boolean} [away] whether the surgeon's tablet was there and is not any more
 */

/** @param {Facts} facts */
export function nowWords(facts) {
  const { view, known, missed, working, wrong, away = false } = facts;
  if (missed) return missedWords(facts);
  if (!known) return "Connecting to the server…";
  if (!working) return "Fix the camera or the lens first. The warning below says what is wrong.";
  if (view !== null) return sessionWords(view, away);
  return wrong
    ? "First fix what the card “Ready for a trial?” marks with a cross."
    : "Choose a participant and a protocol, then prepare the session.";
}

/** @param {Pick<Facts, "heardAt" | "refused" | "signedOut">} facts */
function missedWords({ heardAt, refused, signedOut = false }) {
  if (signedOut) {
    const old = heardAt === null ? "" : ` What this page shows is of ${minuteText(heardAt)}.`;
    return `You are signed out.${old} Press “Sign in” at the top.`;
  }

  const since = heardAt === null ? "" : ` since ${minuteText(heardAt)}`;
  return refused
    ? `The server cannot be reached${since}. Its certificate has ended: renew it, or set this device’s clock.`
    : `The server cannot be reached${since}. Check that it runs and that this device is on its network.`;
}

/**
 * @param {View} view
 * @param {boolean} away
 */
function sessionWords(view, away) {
  if (view.unrecorded)
    return "Make room on the server’s disk. The session’s card says what is not recorded yet.";
  if (view.paused && !isOver(view)) {
    return "Paused: you can focus by hand. Press “Resume” when the surgeon is ready.";
  }

  if (away && isUnderWay(view)) return "The surgeon’s tablet is away: look after it, or press “Pause”.";

  switch (view.phase) {
    case "ready":
      return lacksConsent(view)
        ? "Record the participant’s consent, then start."
        : "Give the surgeon the tablet, then press “Start”.";
    case "notice":
      return `Wait for the surgeon to tap the notice of setting ${view.setting}.`;
    case "inspecting":
      return "Nothing to do: the surgeon is looking. Read the comments as they come.";
    case "questions":
      return `Wait for the surgeon’s answers about setting ${view.setting}.`;
    case "closing":
      return "Wait for the surgeon’s last answers.";
    case "aborted":
      return "You can focus by hand. Press “Close and prepare the next” when the tablet has saved everything.";
    case "completed":
      return "Press “Close and prepare the next” when the surgeon’s tablet says that everything is saved.";
  }
}
