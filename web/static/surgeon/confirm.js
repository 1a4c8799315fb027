// A button that does what cannot be undone, and so wants a second tap that is meant: neither the other half of a double
// tap nor one long after. Its two labels lie on each other, so that nothing moves when they change.

import { setText } from "../shared/dom.js";

/** Sooner than this after the first tap it is the same tap. */
const SAME_TAP_MS = 400;
/** Later than this after the first tap it is a first tap again. */
const FORGOTTEN_MS = 4000;

/** Calls `done()` at the second tap on `button`; `heard` tells screen readers of the first. Returns what forgets that one. */
export function twoTaps(button, heard, done) {
  let armedAt = null;
  let timer = null;

  function arm(at) {
    clearTimeout(timer);
    armedAt = at;
    button.classList.toggle("armed", at !== null);
    setText(heard, at === null ? "" : button.innerText);
    if (at !== null) timer = setTimeout(() => arm(null), FORGOTTEN_MS);
  }

  // A key held down is one press.
  button.addEventListener("keydown", (event) => event.repeat && event.preventDefault());
  button.addEventListener("click", () => {
    const now = performance.now();
    if (armedAt === null) return arm(now);
    if (now - armedAt < SAME_TAP_MS) return;
    arm(null);
    done();
  });
  return () => armedAt !== null && arm(null);
}
