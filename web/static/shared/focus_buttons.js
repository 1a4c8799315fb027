// The buttons beside the picture for where the focus looks: *Centre*, and *Hold focus* where the protocol has it.

import { byId, setText } from "./dom.js";
import { followHeld } from "./held_button.js";
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

  centre.onclick = () => pointing.centre();

  const isKey = (/** @type {KeyboardEvent} */ key) => {
    const inField = document.activeElement?.matches("textarea, select, input, [contenteditable]") ?? false;
    return isHoldKey(key, inField);
  };
  const held = {
    isOpen: () => !button.hidden && !button.disabled,
    isKey,
    press: (/** @type {string} */ by) => hold.press(by),
    release: (/** @type {string} */ by) => hold.release(by),
    leave: () => hold.leave(),
  };
  // Its keys come first: a pedal that holds the focus does not talk.
  followHeld(button, held, true);

  return { follow };
}
