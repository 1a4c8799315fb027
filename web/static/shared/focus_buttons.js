// The buttons beside the picture for where the focus looks: *Centre*, and *Hold focus* where the protocol has it.

import { byId, setText } from "./dom.js";
import { Hold, isHoldKey } from "./hold.js";
import { say } from "./language.js";
import { tell, tellTrouble } from "./trouble.js";

/** @typedef {Pick<Api.SurgeonView, "phase" | "paused" | "pointing" | "holding" | "focus_held">} View */

/**
 * Says in `element` why the focus was not moved; with null, that nothing is wrong any more.
 *
 * @param {HTMLElement} element
 * @param {unknown} trouble
 */
export function tellPointing(element, trouble) {
  if (typeof trouble === "string" || trouble === null) tell(element, trouble ?? "");
  else tellTrouble(element, trouble, say("not-pointed-server"));
}

/**
 * @param {import("./pointing.js").Pointing} pointing
 * @param {(hold: boolean) => Promise<void>} ask asks the server to hold or to release the focus; never rejects
 */
export function focusButtons(pointing, ask) {
  const centre = byId("centre", HTMLButtonElement);
  const button = byId("hold", HTMLButtonElement);
  const hold = new Hold({ ask, now: () => performance.now() });

  /**
   * Follows what may be done now, and whether the focus is held. Outside sessions one may always point.
   *
   * @param {View | null} session
   * @param {boolean} [isOver] whether the page's link is over, so that nothing may be done any more
   */
  function follow(session, isOver = false) {
    const inspecting = session?.phase === "inspecting";
    const looking = inspecting && !session.paused;
    const mayPoint = !isOver && (session === null || (session.pointing && looking));
    const held = session?.focus_held ?? false;

    pointing.allowed = mayPoint;
    if (!mayPoint) pointing.takeBack();
    hold.follow(held);
    centre.hidden = isOver || !(session === null || (session.pointing && inspecting));
    centre.disabled = !mayPoint;
    button.hidden = isOver || !(inspecting && session.holding);
    button.disabled = !looking;
    button.setAttribute("aria-pressed", String(held));
    setText(button, held ? say("focus-held") : say("hold-focus"));
  }

  const open = () => !button.hidden && !button.disabled;

  centre.onclick = () => pointing.centre();

  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || !open()) return;
    // Keeps focus and selection where they are, in case a comment is being typed.
    event.preventDefault();
    button.setPointerCapture(event.pointerId);
    hold.press(`pointer ${event.pointerId}`);
  });
  // On the whole window: the finger may have left the button.
  for (const end of ["pointerup", "pointercancel"]) {
    addEventListener(end, (event) => {
      if (event instanceof PointerEvent) hold.release(`pointer ${event.pointerId}`);
    });
  }
  button.addEventListener("contextmenu", (event) => event.preventDefault());

  addEventListener(
    "keydown",
    (event) => {
      const at = document.activeElement;
      const inField = at?.matches("textarea, select, input, [contenteditable]") ?? false;
      const onButton = at === button && (event.key === " " || event.key === "Enter");
      if (!open() || event.isComposing || !(onButton || isHoldKey(event, inField))) return;
      event.preventDefault();
      event.stopImmediatePropagation();
      if (!event.repeat) hold.press(`key ${event.code || event.key}`);
    },
    true,
  );
  addEventListener("keyup", (event) => {
    if (hold.release(`key ${event.code || event.key}`)) event.preventDefault();
  });
  const leave = () => hold.leave();
  addEventListener("blur", leave);
  addEventListener("pagehide", leave);
  document.addEventListener("visibilitychange", () => document.hidden && leave());

  return { follow };
}
