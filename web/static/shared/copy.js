// A button that copies a text to the clipboard.

import { setText } from "./dom.js";

/** How long the button says that it has copied. */
const TOLD_MS = 2000;

/**
 * Copies the text of `source` when `button` is pressed.
 *
 * @param {HTMLButtonElement} button
 * @param {HTMLElement} source
 */
export function copyOnPress(button, source) {
  const label = button.textContent ?? "";
  button.onclick = async () => {
    const text = source instanceof HTMLInputElement ? source.value : (source.textContent ?? "");
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      // The clipboard interface is missing on plain http.
      if (source instanceof HTMLInputElement) source.select();
      else getSelection()?.selectAllChildren(source);
      document.execCommand("copy");
    }
    setText(button, "Copied");
    setTimeout(() => setText(button, label), TOLD_MS);
  };
}
