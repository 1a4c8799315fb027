// The keys that talk while they are held: the space bar, and what pedals send.

/** Keys that write nothing and that nothing else on the page uses: they talk wherever the focus is. */
const PEDAL_KEYS = ["F13", "F14", "F15", "F16", "F17", "F18", "F19", "F20", "F21", "F22", "F23", "F24"];

/**
 * Where the focus is: in a field in which people write, on something that the space bar works, or
 * on neither.
 *
 * @typedef {"field" | "control" | "page"} Focus
 */

/**
 * Whether `key`, pressed where the focus is, talks.
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
 * What the focus is on.
 *
 * @param {Element | null} element
 * @returns {Focus}
 */
export function focusOn(element) {
  if (element === null) return "page";
  if (element.matches("textarea, select, input:not([type=checkbox], [type=radio]), [contenteditable]")) {
    return "field";
  }
  return element.matches("a, button, input, summary, [role=slider], [tabindex]") ? "control" : "page";
}
