// Draws the devices' health on the operator's page.

import { announce, make, redraw } from "../shared/dom.js";
import { lamps, warnings } from "./device_words.js";

/** @typedef {Stream.OperatorStatus} Status */

/**
 * Draws a lamp for camera, lens, loop and tablet into `list`.
 *
 * @param {HTMLElement} list
 * @param {Status} status
 */
export function drawLamps(list, status) {
  const lines = lamps(status).map(({ name, figure, level, title }) =>
    make(
      "li",
      { className: `badge ${level}`, title },
      make("span", { className: "lamp", "aria-hidden": "true" }),
      make("span", { className: "name" }, name),
      figure !== "" && make("span", { className: "number" }, figure),
    ),
  );
  redraw(list, lines);
}

/**
 * Draws what camera, lens and loop report about themselves into the description list `list`.
 *
 * @param {HTMLElement} list
 * @param {Status} status
 */
export function drawDeviceWords(list, { camera, lens, priority }) {
  redraw(list, [
    ...deviceTerm("Camera", camera),
    ...deviceTerm("Lens", lens),
    make("dt", {}, "Focus loop"),
    make("dd", { className: "muted" }, priority.message),
  ]);
}

/**
 * @param {string} term
 * @param {{ name: string, message: string }} device
 */
function deviceTerm(term, { name, message }) {
  const about = make("span", { className: "muted" }, message);
  return [make("dt", {}, term), make("dd", {}, make("span", {}, `${name}: `), about)];
}

/**
 * Draws a line for each warning into `box`, and announces them in `heard`.
 *
 * @param {HTMLElement} box
 * @param {HTMLElement} heard
 * @param {Status} status
 * @param {boolean} inSession whether a session has started and not ended
 */
export function drawWarnings(box, heard, status, inSession) {
  const all = warnings(status, inSession);
  redraw(
    box,
    all.map(({ text, level }) => make("p", { className: `notice-line ${level}` }, text)),
  );
  announce(heard, all.map(({ text }) => text).join(" "));
}
