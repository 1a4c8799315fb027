// Where a page says why something was not done, until the server answers again.

import { inWords, Refused } from "./api.js";
import { setText } from "./dom.js";

/** Elements that say that the server did not answer. */
const waiting = new Set();

/**
 * Says in `element` why something was not done.
 *
 * @param {HTMLElement} element
 * @param {unknown} error
 * @param {string} [noAnswer] the words for a server that did not answer
 */
export function tellTrouble(element, error, noAnswer) {
  if (error instanceof Refused) tell(element, inWords(error));
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

/** Takes back what was said about a server that did not answer. */
export function serverAnswered() {
  for (const element of waiting) setText(element, "");
  waiting.clear();
}
