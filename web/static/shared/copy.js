// Buttons that copy a text to the clipboard.

import { make, setText } from "./dom.js";

/** How long the button says that it has copied. */
const TOLD_MS = 2000;

/**
 * Copies the text of `source` when `button` is pressed.
 *
 * @param {HTMLButtonElement} button
 * @param {HTMLElement} source
 */
export function copyOnPress(button, source) {
  const text = () => (source instanceof HTMLInputElement ? source.value : (source.textContent ?? ""));
  copyWhenPressed(button, text, () => {
    if (source instanceof HTMLInputElement) source.select();
    else getSelection()?.selectAllChildren(source);
    return document.execCommand("copy");
  });
}

/**
 * Copies what `text` returns when `button` is pressed. The text stands nowhere on the page.
 *
 * @param {HTMLButtonElement} button
 * @param {() => string} text
 */
export function copyText(button, text) {
  copyWhenPressed(button, text, () => copySelected(text(), button));
}

/**
 * @param {HTMLButtonElement} button
 * @param {() => string} text
 * @param {() => boolean} otherwise copies without the clipboard interface, which is missing on plain http; returns
 *   whether it could
 */
function copyWhenPressed(button, text, otherwise) {
  const label = button.textContent ?? "";
  button.onclick = async () => {
    let copied = true;
    try {
      await navigator.clipboard.writeText(text());
    } catch {
      copied = otherwise();
    }
    setText(button, copied ? "Copied" : "Not copied");
    setTimeout(() => setText(button, label), TOLD_MS);
  };
}

/**
 * Copies `text` by selecting it in a field that nobody sees.
 *
 * @param {string} text
 * @param {HTMLElement} beside has the focus before and after
 */
function copySelected(text, beside) {
  const field = make("textarea", { className: "visually-hidden", value: text, "aria-hidden": "true" });
  beside.after(field);
  field.select();
  const copied = document.execCommand("copy");
  field.remove();
  beside.focus({ preventScroll: true });
  return copied;
}
