// A button that asks for a second press. Its two labels, `.first` and `.second`, lie on top of each other, so that
// nothing moves when they change.

import { setText } from "../shared/dom.js";
import { Confirmation, FORGOTTEN_MS } from "./confirm.js";

/**
 * Calls `done()` at the second press on `button`. The element `heard` announces the first press to screen readers.
 * Returns a function that forgets the first press.
 *
 * @param {HTMLElement} button
 * @param {HTMLElement} heard
 * @param {() => void} done
 */
export function askForSecondPress(button, heard, done) {
  const confirmation = new Confirmation();
  const second = button.querySelector(".second")?.textContent ?? "";
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer;

  /** @param {boolean} armed */
  function draw(armed) {
    button.classList.toggle("armed", armed);
    setText(heard, armed ? second : "");
  }

  function forget() {
    clearTimeout(timer);
    confirmation.forget();
    draw(false);
  }

  // A key that is held down counts as one press.
  button.addEventListener("keydown", (event) => event.repeat && event.preventDefault());
  button.addEventListener("click", () => {
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
