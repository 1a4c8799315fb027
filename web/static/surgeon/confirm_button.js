// A button that asks for a second press. Its two labels, `.first` and `.second`, lie on each other,
// so that nothing moves when they change.

import { setText } from "../shared/dom.js";
import { Confirmation, FORGOTTEN_MS } from "./confirm.js";

/**
 * Calls `done()` at the second press on `button`; `heard` tells screen readers of the first.
 * Returns what forgets the first press.
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

  // A key held down is one press.
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
