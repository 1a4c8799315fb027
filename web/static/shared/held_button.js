// A button that does something while it is held: by a finger, the mouse, a key, or a pedal that acts as a key.

/**
 * What becomes of the button. `by` names what holds it.
 *
 * @typedef {object} Held
 * @property {() => boolean} isOpen whether it can be held now
 * @property {(key: KeyboardEvent) => boolean} isKey whether a key holds it, also when the button has not the focus
 * @property {(by: string) => void} press
 * @property {(by: string) => boolean} release returns whether this was what held it
 * @property {() => void} leave called when the page can no longer notice whether it is held
 */

/**
 * Follows how `button` is held.
 *
 * @param {HTMLButtonElement} button
 * @param {Held} held
 * @param {boolean} [first] whether its keys are for nothing else on the page
 */
export function followHeld(button, { isOpen, isKey, press, release, leave }, first = false) {
  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || !isOpen()) return;
    // Keeps focus and selection where they are, in case a comment is being typed.
    event.preventDefault();
    button.setPointerCapture(event.pointerId);
    press(`pointer ${event.pointerId}`);
  });
  // On the whole window: the finger may have left the button.
  for (const end of ["pointerup", "pointercancel"]) {
    addEventListener(end, (event) => {
      if (event instanceof PointerEvent) release(`pointer ${event.pointerId}`);
    });
  }
  // A long press must not open a menu.
  button.addEventListener("contextmenu", (event) => event.preventDefault());

  const keydown = (/** @type {KeyboardEvent} */ event) => {
    const onButton = document.activeElement === button && (event.key === " " || event.key === "Enter");
    if (!isOpen() || event.isComposing || !(onButton || isKey(event))) return;
    // The key must not scroll the page, nor press again and again while it is held.
    event.preventDefault();
    if (first) event.stopImmediatePropagation();
    if (!event.repeat) press(`key ${event.code || event.key}`);
  };
  addEventListener("keydown", keydown, first);
  addEventListener("keyup", (event) => {
    if (release(`key ${event.code || event.key}`)) event.preventDefault();
  });

  addEventListener("blur", leave);
  addEventListener("pagehide", leave);
  document.addEventListener("visibilitychange", () => document.hidden && leave());
}
