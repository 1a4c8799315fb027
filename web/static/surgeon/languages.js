// The languages of the pages that surgeons see, and how such a page shows which one it speaks.

import { text as german } from "../languages/de.js";
import { text as spanish } from "../languages/es.js";
import { text as french } from "../languages/fr.js";
import { setText } from "../shared/dom.js";
import { language, offer, partsOf, say, sayAttribute, speak } from "../shared/language.js";

offer("de", german);
offer("fr", french);
offer("es", spanish);

/** Languages that are written from right to left. */
const RIGHT_TO_LEFT = ["ar", "fa", "he", "ur"];

/** Speaks the language in which the server sent the page. */
export function speakAsThePage() {
  speak(document.documentElement.lang);
  remember();
}

/** Tells the server the language, so that this tablet stays in it on pages that are loaded without a session. */
function remember() {
  // biome-ignore lint/suspicious/noDocumentCookie: older tablets have no Cookie Store API.
  document.cookie = `parfocal-language=${language()}; path=/; max-age=31536000; samesite=strict`;
}

/** Puts the fixed words of the page into the language that is spoken. */
export function showLanguage() {
  const root = document.documentElement;
  root.lang = language();
  root.dir = RIGHT_TO_LEFT.includes(language()) ? "rtl" : "ltr";
  remember();

  for (const element of document.querySelectorAll("[data-l10n-id]")) {
    const id = element.getAttribute("data-l10n-id") ?? "";
    const { hasText, attributes } = partsOf(id);
    for (const name of attributes) element.setAttribute(name, sayAttribute(id, name));
    if (hasText && element instanceof HTMLElement) setText(element, say(id));
  }
}
