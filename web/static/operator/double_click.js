// Buttons that change into others at a click, such as "Pause" into "Resume".

/** Browsers count taps that follow each other within this time up to three, and then from one again. */
const QUICK_MS = 500;

/** When a click was last ignored. */
let ignoredAt = Number.NEGATIVE_INFINITY;

/**
 * Runs `run` at a click, but not at those that follow in quick succession, as in an emergency: they may hit a button
 * which has just taken the place of the one that was meant.
 *
 * @param {() => unknown} run
 * @returns {(click: { detail: number, timeStamp: number }) => void} `detail` is the number of the click among those in
 *   quick succession; 0 for a key
 */
export function exceptDouble(run) {
  return ({ detail, timeStamp }) => {
    if (detail > 1 || (detail === 1 && timeStamp - ignoredAt < QUICK_MS)) ignoredAt = timeStamp;
    else run();
  };
}

/**
 * A key that is held down presses a button within `element` once. Otherwise it would go on to press the button that takes
 * its place and gets the focus.
 *
 * @param {HTMLElement} element
 */
export function ignoreHeldKeys(element) {
  element.addEventListener("keydown", (event) => {
    if (event.repeat && event.key === "Enter") event.preventDefault();
  });
}
