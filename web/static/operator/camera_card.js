// The camera's settings: a number field for each, with a button for less and one for more.

import { inWords, post, Refused } from "../shared/api.js";
import { byId, make, setText } from "../shared/dom.js";
import { CameraSettings, KINDS, labelOf, SETTLED_MS, shown, typed } from "./camera_settings.js";

/**
 * A setting's element, its field, and the buttons beside it.
 *
 * @typedef {object} Row
 * @property {HTMLElement} element
 * @property {HTMLInputElement} field
 * @property {HTMLButtonElement} less
 * @property {HTMLButtonElement} more
 */

const settings = new CameraSettings();
/** @type {Map<Api.Setting, Row>} */
const rows = new Map();
/** The trouble that the camera has reported, until somebody changes a setting again, here or on another page. */
let reported = "";

/**
 * Draws the settings of `offer`. The card is hidden if the camera offers none.
 *
 * @param {Api.CameraOffer | null} offer
 */
export function drawCamera(offer) {
  settings.offered = offer?.settings ?? [];
  byId("camera-card").hidden = settings.offered.length === 0;
  const report = offer?.trouble ?? "";
  if (report !== reported || report !== "") setText(byId("camera-trouble"), report);
  reported = report;

  for (const [setting, row] of rows) {
    if (settings.find(setting)) continue;
    row.element.remove();
    rows.delete(setting);
  }
  for (const one of settings.offered) drawSetting(one);
}

/** @param {Api.Adjustable} setting */
function drawSetting({ setting, value, min, max }) {
  const { field, less, more } = rows.get(setting) ?? addRow(setting);
  field.min = shown(setting, min);
  field.max = shown(setting, max);
  field.title = `from ${field.min} to ${field.max}`;
  if (document.activeElement !== field) field.value = shown(setting, value);
  less.disabled = value <= min;
  more.disabled = value >= max;
}

/**
 * @param {Api.Setting} setting
 * @returns {Row}
 */
function addRow(setting) {
  const id = `camera-${setting}`;
  const field = make("input", { id, type: "number", step: "any", inputMode: "decimal" });
  field.addEventListener("change", () => change(setting, typed(setting, field.value)));
  field.addEventListener("keydown", (event) => event.key === "Enter" && field.blur());

  const less = stepButton(setting, "less", "−");
  const more = stepButton(setting, "more", "+");
  const element = make(
    "div",
    { className: "setting" },
    make("label", { for: id }, labelOf(setting)),
    make("div", { className: "row" }, less, field, more),
  );

  const row = { element, field, less, more };
  rows.set(setting, row);
  byId("camera-settings").append(element);
  return row;
}

/**
 * @param {Api.Setting} setting
 * @param {"less" | "more"} direction
 * @param {string} sign
 */
function stepButton(setting, direction, sign) {
  const name = direction === "less" ? "Less" : "More";
  const label = `${name} ${KINDS[setting].label.toLowerCase()}`;
  const button = make("button", { type: "button", "aria-label": label }, sign);
  button.onclick = () => {
    const value = settings.step(setting, direction);
    if (value !== null) change(setting, value);
  };
  return button;
}

/**
 * @param {Api.Setting} setting
 * @param {number} value
 */
async function change(setting, value) {
  const trouble = byId("camera-trouble");
  if (!Number.isFinite(value)) {
    setText(trouble, `${KINDS[setting].label} must be a number.`);
    return;
  }

  const forget = settings.ask(setting, value);
  try {
    await post("/api/operator/camera", { setting, value });
    setText(trouble, "");
    setTimeout(forget, SETTLED_MS);
  } catch (error) {
    forget();
    const outOfBounds = error instanceof Refused && error.status === 422;
    setText(trouble, outOfBounds ? settings.boundsWords(setting) : inWords(error));
  }
}
