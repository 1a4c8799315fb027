// The panel over the picture. It shows cards, each with a single message, or the questions.

import { byId, make } from "../shared/dom.js";
import { NOT_MEANT_MS, TapGuard } from "./tap_guard.js";

/** @typedef {{ className: string, nodes: HTMLElement[] }} Content */

const guard = new TapGuard();
/** @type {ReturnType<typeof setTimeout> | undefined} */
let freshTimer;

/**
 * @param {string} className classes of the panel; they decide where the card is placed
 * @param {string} heading
 * @param {string} text
 * @param {HTMLElement | null} [more]
 * @returns {Content}
 */
export function card(className, heading, text, more = null) {
  const title = make("h2", { tabIndex: -1, dir: "auto" }, heading);
  const words = text !== "" && make("p", {}, text);
  const node = make("div", { className: "panel-card", role: "status" }, title, words, more);
  return { className, nodes: [node] };
}

/** @param {Content | null} content */
export function showPanel(content) {
  const panel = byId("panel");
  // What the surgeon has just pressed may be hidden now, and would take the focus with it.
  const lost = isLost(document.activeElement);
  guard.shown(performance.now());
  // Whoever looks from outside sees when the panel takes taps.
  panel.dataset.fresh = "true";
  clearTimeout(freshTimer);
  freshTimer = setTimeout(() => delete panel.dataset.fresh, NOT_MEANT_MS + 20);
  panel.hidden = content === null;
  panel.className = `panel ${content?.className ?? ""}`;
  panel.replaceChildren(...(content?.nodes ?? []));
  panel.scrollTop = 0;

  const heading = panel.querySelector("h2");
  if (heading && lost) heading.focus();
}

/**
 * Whether nothing that one still works with has the focus.
 *
 * @param {Element | null} active
 */
function isLost(active) {
  if (active === null || active === document.body || active === byId("view")) return true;
  return byId("panel").contains(active) || active.getClientRects().length === 0;
}

/** Ignores taps that were meant for what was there before the panel. */
export function guardPanel() {
  const panel = byId("panel");
  panel.addEventListener(
    "pointerdown",
    (event) => guard.touch(performance.now()) || event.stopPropagation(),
    true,
  );
  panel.addEventListener(
    "click",
    (event) => {
      if (guard.click(performance.now(), event.detail === 0)) return;
      event.preventDefault();
      event.stopPropagation();
    },
    true,
  );
}
