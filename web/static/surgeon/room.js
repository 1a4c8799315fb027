// How much of the window is free for the page. A tablet's keyboard covers a part of it: some browsers make the window
// smaller then, others (Safari) only the part that one sees, and move the page away under it.

/** With less than this free, in CSS pixels, only the picture, the box and its button have room while somebody types. */
const LOW = 620;

/** A keyboard takes at least this part of the window. */
const KEYBOARD = 0.2;

/**
 * What the page should do with the height that it has.
 *
 * @param {{ free: number, greatest: number, isTyping: boolean }} room `free` and `greatest` in CSS pixels: the height
 *   that is seen now, and the greatest at this width
 * @returns {{ keyboard: boolean, typing: boolean }} whether a keyboard is up, and whether the page makes room for it
 */
export function judge({ free, greatest, isTyping }) {
  const keyboard = isTyping && free < greatest * (1 - KEYBOARD);
  return { keyboard, typing: isTyping && (keyboard || free < LOW) };
}

/** The greatest height so far, by the window's width: turning a tablet is no keyboard. @type {Map<number, number>} */
const greatest = new Map();

function look() {
  const free = visualViewport?.height ?? innerHeight;
  const width = Math.round(visualViewport?.width ?? innerWidth);
  greatest.set(width, Math.max(greatest.get(width) ?? 0, free));
  const active = document.activeElement;
  const isTyping = active instanceof HTMLTextAreaElement && active.closest(".dock") !== null;
  return { free, ...judge({ free, greatest: greatest.get(width) ?? free, isTyping }) };
}

/** Whether a keyboard covers a part of the page. */
export function isKeyboardUp() {
  return look().keyboard;
}

/** Keeps the picture in view while somebody types, whatever the browser does to the window. */
export function keepRoom() {
  function fit() {
    // Zoomed in by the browser itself: that is somebody's wish.
    if ((visualViewport?.scale ?? 1) > 1.05) return;
    const { free, typing, keyboard } = look();
    document.body.classList.toggle("typing", typing);
    document.body.style.setProperty("--free", `${free}px`);
    // Safari has moved the page up, so that its box is above the keyboard. There is room for all of it now.
    if (keyboard) scrollTo(0, 0);
  }

  visualViewport?.addEventListener("resize", fit);
  addEventListener("resize", fit);
  for (const way of ["focusin", "focusout"]) document.addEventListener(way, () => setTimeout(fit, 0));
  fit();
}
