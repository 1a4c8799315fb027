// Small helpers for making and finding elements. Text only ever goes in as text, never as markup.

/** The element with this id. */
export const byId = (id) => document.getElementById(id);

/**
 * A new element. Properties are set as properties (`className`, `onclick`), except names with a dash and `role`, `for`,
 * which become attributes; children are nodes or text, and nothing is made of null or false.
 */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === null || value === undefined) continue;
    if (name.includes("-") || name === "role" || name === "for") element.setAttribute(name, value);
    else element[name] = value;
  }
  element.append(...children.filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

/** Sets text only where it differs, so that screen readers hear changes and nothing else. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Replaces the children of `parent` only where they differ: nothing is heard twice, and focus and selection stay. */
export function redraw(parent, nodes) {
  const markup = nodes.map((node) => node.outerHTML).join("");
  if (parent.dataset.markup === markup) return;
  parent.dataset.markup = markup;
  parent.replaceChildren(...nodes);
}

/** A random UUID, version 4. `crypto.randomUUID` is missing on plain http, which is what a tablet in theatre uses. */
export function uuid() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  bytes[6] = (bytes[6] & 0x0f) | 0x40;
  bytes[8] = (bytes[8] & 0x3f) | 0x80;
  const hex = [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
  return hex.replace(/^(.{8})(.{4})(.{4})(.{4})(.{12})$/, "$1-$2-$3-$4-$5");
}

/** Seconds as `1:05`: those gone by, counted when whole; with `Math.ceil`, those left. */
export function clockText(seconds, round = Math.floor) {
  const whole = Math.max(0, round(seconds));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}
