// The keys that record voice while they are held: the space bar, and the keys that pedals send.

/** Keys that write nothing and that nothing else on the page uses. They work wherever the focus is. */
const PEDAL_KEYS = ["F13", "F14", "F15", "F16", "F17", "F18", "F19", "F20", "F21", "F22", "F23", "F24"];

/**
 * Where the focus is: in a field for text, on a control that the space bar operates, or on neither.
 *
 * @typedef {"field" | "control" | "page"} Focus
 */

/**
 * Whether `key` records voice, given where the focus is.
 *
 * @param {{ key: string, ctrlKey?: boolean, altKey?: boolean, metaKey?: boolean }} pressed
 * @param {Focus} focus
 */
export function isTalkKey({ key, ctrlKey, altKey, metaKey }, focus) {
  if (ctrlKey || altKey || metaKey) return false;
  if (PEDAL_KEYS.includes(key)) return true;
  if (key === "PageDown") return focus !== "field";
  return key === " " && focus === "page";
}

/**
 * The kind of element that has the focus.
 *
 * @param {Element | null} element
 * @returns {Focus}
 */
export function focusOn(element) {
  if (element === null) return "page";
  // Nothing is written yet in an empty box, so a pedal that sends a space is meant for the pedal's work.
  if (element instanceof HTMLTextAreaElement && element.value === "") return "page";
  if (element.matches("textarea, select, input:not([type=checkbox], [type=radio]), [contenteditable]")) {
    return "field";
  }
  return element.matches("a, button, input, summary, [role=slider], [tabindex]") ? "control" : "page";
}
