// A button for what cannot be undone: pressed twice, or held down. Its two labels, `.first` and `.second`, lie on top
// of each other, so that nothing moves when they change.

import { setText } from "../shared/dom.js";
import { Confirmation, FORGOTTEN_MS } from "./confirm.js";

/** How long a finger has to stay. The button fills in this time: page.css. */
const HELD_MS = 800;

/**
 * Calls `done()` at the second press on `button`, or when it was held down. The element `heard` announces the first
 * press to screen readers. Returns a function that forgets the first press, and one that is still held.
 *
 * @param {HTMLElement} button
 * @param {HTMLElement} heard
 * @param {() => void} done
 */
export function askForSecondPress(button, heard, done) {
  const confirmation = new Confirmation();
  const second = () => button.querySelector(".second")?.textContent ?? "";
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let holdTimer;
  /** The end of a press that was held is no press of its own. */
  let wasHeld = false;

  /** @param {boolean} armed */
  function draw(armed) {
    button.classList.toggle("armed", armed);
    setText(heard, armed ? second() : "");
  }

  function letGo() {
    clearTimeout(holdTimer);
    button.classList.remove("held");
  }

  function forget() {
    letGo();
    clearTimeout(timer);
    confirmation.forget();
    draw(false);
  }

  button.addEventListener("pointerdown", ({ isPrimary, button: which, pointerId }) => {
    wasHeld = false;
    if (!isPrimary || which !== 0) return;
    // A finger belongs to what it touched first, and would not be seen to slide off.
    button.releasePointerCapture(pointerId);
    button.classList.add("held");
    holdTimer = setTimeout(() => {
      wasHeld = true;
      forget();
      done();
    }, HELD_MS);
  });
  for (const end of ["pointerup", "pointercancel", "pointerleave"]) button.addEventListener(end, letGo);
  // A long press asks for a menu.
  button.addEventListener("contextmenu", (event) => event.preventDefault());

  button.addEventListener("keydown", (event) => {
    wasHeld = false;
    // A key that is held down counts as one press.
    if (event.repeat) event.preventDefault();
  });
  button.addEventListener("click", () => {
    if (wasHeld) return;
    const press = confirmation.press(performance.now());
    if (press === "first") {
      clearTimeout(timer);
      timer = setTimeout(forget, FORGOTTEN_MS);
      draw(true);
    }
    if (press === "second") {
      forget();
      done();
    }
  });
  return forget;
}
