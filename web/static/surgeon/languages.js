// The languages of the pages that surgeons see, and how such a page shows which one it speaks.

import { setText } from "../shared/dom.js";
import { knows, language, partsOf, say, sayAttribute } from "../shared/language.js";

/** Languages that are written from right to left. */
const RIGHT_TO_LEFT = ["ar", "fa", "he", "ur"];

/** The scripts that are being loaded, by their language. @type {Map<string, Promise<boolean>>} */
const loading = new Map();
let failures = 0;

/**
 * Loads a language that this page does not know yet, as when the page is older than the session. Returns whether it is
 * known now. A failure is no reason to give up: whoever needs the language asks again.
 *
 * @param {string} code
 */
export function learn(code) {
  const begun = loading.get(code) ?? load(code);
  loading.set(code, begun);
  return begun;
}

/** @param {string} code */
async function load(code) {
  // Browsers do not ask again for a module that they once failed to get.
  const again = failures === 0 ? "" : `?${failures}`;
  try {
    await import(`../languages/${code}.js${again}`);
  } catch {
    failures += 1;
  }
  loading.delete(code);
  return knows(code);
}

/** Tells the server the language, so that this tablet stays in it on pages that are loaded without a session. */
export function keepLanguage() {
  // biome-ignore lint/suspicious/noDocumentCookie: older tablets have no Cookie Store API.
  document.cookie = `parfocal-language=${language()}; path=/; max-age=31536000; samesite=strict`;
}

/** Puts the fixed words of the page into the language that is spoken. */
export function showLanguage() {
  const root = document.documentElement;
  root.lang = language();
  root.dir = RIGHT_TO_LEFT.includes(language()) ? "rtl" : "ltr";
  keepLanguage();

  for (const element of document.querySelectorAll("[data-l10n-id]")) {
    const id = element.getAttribute("data-l10n-id") ?? "";
    const { hasText, attributes } = partsOf(id);
    for (const name of attributes) element.setAttribute(name, sayAttribute(id, name));
    if (hasText && element instanceof HTMLElement) setText(element, say(id));
  }
}
