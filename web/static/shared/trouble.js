// Messages on a page that say why something was not done. If the server did not answer, or nobody was signed in, they
// disappear once that has changed.

import { inWords, Refused } from "./api.js";
import { setText } from "./dom.js";

/** Elements that show a message until the server answers again. */
const waiting = new Set();

/**
 * Says in `element` why something was not done.
 *
 * @param {HTMLElement} element
 * @param {unknown} error
 * @param {string} [noAnswer] the text if the server did not answer
 */
export function tellTrouble(element, error, noAnswer) {
  if (error instanceof Refused && !error.needsSignIn) tell(element, inWords(error));
  else tellUntilAnswered(element, inWords(error, noAnswer));
}

/**
 * @param {HTMLElement} element
 * @param {string} text
 */
export function tell(element, text) {
  waiting.delete(element);
  setText(element, text);
}

/**
 * Says `text` in `element` until the server answers again.
 *
 * @param {HTMLElement} element
 * @param {string} text
 */
export function tellUntilAnswered(element, text) {
  waiting.add(element);
  setText(element, text);
}

/** Clears the messages that were shown until the server answers again. */
export function serverAnswered() {
  for (const element of waiting) setText(element, "");
  waiting.clear();
}
