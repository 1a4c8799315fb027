// Buttons that change into others at a click, such as "Pause" into "Resume".

/**
 * Runs `run` at a click, but not at the other half of a double click: that one may hit a button which has just taken the
 * place of the one that was meant.
 *
 * @param {() => unknown} run
 * @returns {(click: { detail: number }) => void} `detail` is the number of the click among those in quick succession
 */
export function exceptDouble(run) {
  return ({ detail }) => {
    if (detail !== 2) run();
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
