// The panel over the picture. It shows cards, each with a single message, or the questions.

import { byId, make } from "../shared/dom.js";

/** @typedef {{ className: string, nodes: HTMLElement[] }} Content */

/**
 * @param {string} className classes of the panel; they decide where the card is placed
 * @param {string} heading
 * @param {string} text
 * @param {HTMLElement | null} [more]
 * @returns {Content}
 */
export function card(className, heading, text, more = null) {
  const title = make("h2", { tabIndex: -1 }, heading);
  const node = make("div", { className: "panel-card", role: "status" }, title, make("p", {}, text), more);
  return { className, nodes: [node] };
}

/** @param {Content | null} content */
export function showPanel(content) {
  const panel = byId("panel");
  panel.hidden = content === null;
  panel.className = `panel ${content?.className ?? ""}`;
  panel.replaceChildren(...(content?.nodes ?? []));
  panel.scrollTop = 0;

  const heading = panel.querySelector("h2");
  const active = document.activeElement;
  if (heading && (active === document.body || active === byId("view"))) heading.focus();
}
