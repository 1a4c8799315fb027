// Exposure, gain and frame rate of a camera that lets them be changed: a figure to type, and a button either way.

import { inWords, post } from "../shared/api.js";
import { byId, make, setText } from "../shared/dom.js";

// Exposure comes in microseconds and is shown in milliseconds. A third of a stop is the step that photographers know.
const THIRD = 2 ** (1 / 3);
const SETTINGS = {
  exposure: { label: "Exposure", unit: "ms", per: 1000, less: (value) => value / THIRD, more: (value) => value * THIRD },
  gain: { label: "Gain", unit: "", per: 1, less: (value) => value - 1, more: (value) => value + 1 },
  "frame-rate": { label: "Frame rate", unit: "fps", per: 1, less: (value) => value - 1, more: (value) => value + 1 },
};

// A value just asked for counts as the setting's until the camera had time to say what it made of it, so that quick taps add up.
const SETTLED_MS = 2000;

const rows = new Map();
const asked = new Map();
let offered = [];

/** Draws what `offer` holds; the card is hidden where the camera offers nothing. */
export function drawCamera(offer) {
  offered = offer?.settings ?? [];
  byId("camera-card").hidden = offered.length === 0;
  if (offer?.trouble) setText(byId("camera-trouble"), offer.trouble);
  for (const [name, row] of rows) if (!find(name)) row.remove();
  for (const name of rows.keys()) if (!find(name)) rows.delete(name);
  for (const one of offered) drawSetting(one);
}

const find = (name) => offered.find(({ setting }) => setting === name);
const shown = (value, per) => String(Number((value / per).toPrecision(4)));

function drawSetting({ setting, value, min, max }) {
  const { per } = SETTINGS[setting];
  if (!rows.has(setting)) {
    rows.set(setting, makeRow(setting));
    byId("camera-settings").append(rows.get(setting));
  }
  const row = rows.get(setting);
  const field = row.querySelector("input");
  [field.min, field.max] = [shown(min, per), shown(max, per)];
  field.title = `from ${field.min} to ${field.max}`;
  if (document.activeElement !== field) field.value = shown(value, per);
  const [less, more] = row.querySelectorAll("button");
  [less.disabled, more.disabled] = [value <= min, value >= max];
}

function makeRow(setting) {
  const { label, unit, per, less, more } = SETTINGS[setting];
  const id = `camera-${setting}`;
  const field = make("input", { id, type: "number", step: "any", inputMode: "decimal" });
  field.addEventListener("change", () => change(setting, field.value.trim() === "" ? Number.NaN : Number(field.value) * per));
  field.addEventListener("keydown", (event) => event.key === "Enter" && field.blur());
  const button = (text, name, step) => make("button", { type: "button", "aria-label": `${name} ${label.toLowerCase()}`, onclick: () => nudge(setting, step) }, text);
  return make(
    "div",
    { className: "setting" },
    make("label", { for: id }, unit ? `${label}, ${unit}` : label),
    make("div", { className: "row" }, button("−", "Less", less), field, button("+", "More", more)),
  );
}

function nudge(setting, step) {
  const now = find(setting);
  if (now) change(setting, Math.min(Math.max(step(asked.get(setting) ?? now.value), now.min), now.max));
}

async function change(setting, value) {
  if (!Number.isFinite(value)) {
    setText(byId("camera-trouble"), `${SETTINGS[setting].label} must be a number.`);
    return;
  }
  asked.set(setting, value);
  const forget = () => asked.get(setting) === value && asked.delete(setting);
  try {
    await post("/api/operator/camera", { setting, value });
    setText(byId("camera-trouble"), "");
    setTimeout(forget, SETTLED_MS);
  } catch (error) {
    forget();
    setText(byId("camera-trouble"), error.status === 422 ? inBounds(setting) : inWords(error));
  }
}

/** The bounds in the unit that is shown. */
function inBounds(setting) {
  const { label, unit, per } = SETTINGS[setting];
  const now = find(setting);
  return now ? `${label} must be from ${shown(now.min, per)} to ${shown(now.max, per)} ${unit}`.trimEnd() + "." : "The camera does not offer this setting now.";
}
