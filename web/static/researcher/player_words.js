// Texts beside the playback.

import { nearestPoint, powerOf, settingAt } from "./timeline.js";

/** Values further away in time than this are not shown for the moment on screen. In seconds. */
const NEAR = 2;

/**
 * A moment as `1:05.2`.
 *
 * @param {number} seconds
 */
export function momentText(seconds) {
  const tenths = Math.floor(Math.abs(seconds) * 10 + 1e-6);
  const minutes = Math.floor(tenths / 600);
  const rest = ((tenths % 600) / 10).toFixed(1).padStart(4, "0");
  return `${seconds < 0 && tenths > 0 ? "−" : ""}${minutes}:${rest}`;
}

/**
 * Where the focus looks at a moment: what was chosen last, in the same setting unless choices stay.
 *
 * @param {Api.Timeline} timeline
 * @param {number} seconds
 */
function focusAt({ choices, holds, settings, patch_stays: stays }, seconds) {
  const setting = settings.find(({ from, to }) => from <= seconds && (to == null || seconds <= to));
  if (!setting) return "–";
  const isHeld = holds.some(({ from, to }) => from <= seconds && (to == null || seconds <= to));
  const held = isHeld ? ", held" : "";
  const from = stays ? 0 : setting.from;
  const last = choices.findLast((choice) => from <= choice.seconds && choice.seconds <= seconds);
  if (last?.x == null || last.y == null) return `centre${held}`;
  return `${last.x.toFixed(0)}, ${last.y.toFixed(0)}${held}`;
}

/**
 * The values known for the moment on screen, as pairs of name and value.
 *
 * @param {Api.Timeline} timeline
 * @param {string[]} policies
 * @param {number} seconds
 * @returns {[string, string][]}
 */
export function valuesAt(timeline, policies, seconds) {
  /** @type {[string, string][]} */
  const values = [];
  const setting = settingAt(timeline.settings, seconds);
  const policy = setting === null ? undefined : policies[setting - 1];
  const none = "none under way";
  values.push(["Setting", setting === null ? none : `${setting}${policy ? `, ${policy}` : ""}`]);

  const point = setting === null ? null : nearestPoint(timeline.points, seconds);
  const near = point && point.setting === setting && Math.abs(point.seconds - seconds) <= NEAR ? point : null;
  values.push(["Focal power", near ? powerOf(near).toFixed(3) : "–"]);
  if (timeline.points.some(({ optimal }) => optimal != null)) {
    values.push(["Optimum", near?.optimal == null ? "–" : near.optimal.toFixed(3)]);
  }
  if (timeline.choices.length > 0) values.push(["Focus", focusAt(timeline, seconds)]);
  values.push(["Metric", near?.metric == null ? "–" : near.metric.toPrecision(4)]);
  return values;
}
