// Texts beside the playback.

import { Refused } from "../shared/api.js";
import { nearestPoint, powerOf, settingAt, spanAt } from "./timeline.js";

/** Values further away in time than this are not shown for the moment on screen. In seconds. */
const NEAR = 2;

/** Mosaic cells along each side of the patch. */
const PATCH = 32;

/** The server's status if a recording is damaged. */
export const DAMAGED = 500;

/**
 * Says why there is no picture of a frame; null if the server may give one later: it is busy, restarts behind a proxy,
 * cannot read its disk, or somebody has to sign in first.
 *
 * @param {unknown} error
 */
export function whyNoPicture(error) {
  if (!(error instanceof Refused)) return null;
  const isOfFrame = error.final || (error.ours && error.status === DAMAGED);
  return isOfFrame ? error.message : null;
}

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
 * What was chosen last at a moment, in the same setting unless choices stay; null for the centre.
 *
 * @param {Api.Timeline} timeline
 * @param {number} seconds
 */
function choiceAt({ choices, settings, patch_stays: stays }, seconds) {
  const setting = spanAt(settings, seconds);
  if (!setting) return null;
  const from = stays ? 0 : setting.from;
  const last = choices.findLast((choice) => from <= choice.seconds && choice.seconds <= seconds);
  return last?.x == null || last.y == null ? null : { x: last.x, y: last.y, seconds: last.seconds };
}

/**
 * Where the focus looks at a moment, in words.
 *
 * @param {Api.Timeline} timeline
 * @param {number} seconds
 */
function focusAt(timeline, seconds) {
  if (settingAt(timeline.settings, seconds) === null) return "–";
  const held = spanAt(timeline.holds, seconds) ? ", held" : "";
  const choice = choiceAt(timeline, seconds);
  return choice ? `${choice.x.toFixed(0)}, ${choice.y.toFixed(0)}${held}` : `centre${held}`;
}

/**
 * The patch at a moment, in mosaic cells; null unless somebody has chosen its place.
 *
 * @param {Api.Timeline} timeline
 * @param {number} seconds
 * @returns {Stream.Patch | null}
 */
export function chosenPatchAt(timeline, seconds) {
  const choice = choiceAt(timeline, seconds);
  if (!choice) return null;
  // The point before the choice has the patch at its place before.
  const since = timeline.points.filter((point) => point.seconds >= choice.seconds);
  const point = nearestPoint(since, seconds);
  if (!point || Math.abs(point.seconds - seconds) > NEAR) return null;
  return { x: point.patch_x, y: point.patch_y, width: PATCH, height: PATCH };
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
