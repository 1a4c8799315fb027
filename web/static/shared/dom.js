// Finding and making elements. Text is only ever set as text, never as markup.

/**
 * The element with this id. Throws if there is none, or if it is not of class `kind`.
 *
 * @template {HTMLElement} [Kind=HTMLElement]
 * @param {string} id
 * @param {new () => Kind} [kind]
 * @returns {Kind}
 */
export function byId(id, kind) {
  const element = document.getElementById(id);
  if (!(element instanceof (kind ?? HTMLElement))) throw new Error(`the page has no such element as #${id}`);
  return /** @type {Kind} */ (element);
}

/**
 * A new element. Properties are set as properties (`className`, `onclick`). Names with a dash,
 * `role` and `for` become attributes. Children are nodes or text; null and false are left out.
 *
 * @template {keyof HTMLElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {Record<string, unknown>} [properties]
 * @param {...(Node | string | false | null | undefined)} children
 * @returns {HTMLElementTagNameMap[Tag]}
 */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === null || value === undefined) continue;
    if (name.includes("-") || name === "role" || name === "for") element.setAttribute(name, String(value));
    else Reflect.set(element, name, value);
  }

  for (const child of children) {
    if (child !== null && child !== undefined && child !== false) element.append(child);
  }
  return element;
}

/**
 * Sets the text only if it differs, so that screen readers announce changes and nothing else.
 *
 * @param {HTMLElement} element
 * @param {string} text
 */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** What was announced last, without its numbers. @type {WeakMap<HTMLElement, string>} */
const announced = new WeakMap();

/**
 * Says `text` in `element`, which screen readers read out at each change. A text that differs from the last one by its
 * numbers alone is no news: it may count seconds.
 *
 * @param {HTMLElement} element
 * @param {string} text
 */
export function announce(element, text) {
  const news = text.replace(/[\d.]+/g, "#");
  if (announced.get(element) === news) return;
  announced.set(element, news);
  element.textContent = text;
}

/** @type {WeakMap<HTMLElement, string>} */
const drawn = new WeakMap();

/**
 * Replaces the children of `parent` only if they differ. So nothing is read out twice, and focus and selection stay.
 *
 * @param {HTMLElement} parent
 * @param {HTMLElement[]} nodes
 */
export function redraw(parent, nodes) {
  const markup = nodes.map((node) => node.outerHTML).join("");
  if (drawn.get(parent) === markup) return;
  drawn.set(parent, markup);
  parent.replaceChildren(...nodes);
}
