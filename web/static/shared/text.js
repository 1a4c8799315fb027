// How times and counts are written.

import { language } from "./language.js";

/**
 * Seconds as `1:05`. Elapsed time is rounded down. For remaining time, pass `Math.ceil`.
 *
 * @param {number} seconds
 * @param {(seconds: number) => number} [round]
 */
export function clockText(seconds, round = Math.floor) {
  const whole = Math.max(0, round(seconds));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

/**
 * The time of day as `14:02`.
 *
 * @param {number} millis since 1970
 */
export function minuteText(millis) {
  return new Date(millis).toLocaleTimeString(language(), {
    hour: "2-digit",
    minute: "2-digit",
    hourCycle: "h23",
  });
}

/**
 * The time of day as `14:02:05`, in this device's time zone.
 *
 * @param {string} moment
 */
export function secondText(moment) {
  // With `hour12: false` some browsers write the hour after midnight as 24.
  return new Date(moment).toLocaleTimeString([], { hourCycle: "h23" });
}

/**
 * The time of day in `zone`, as `14:02`. If this browser does not know the zone, its own is used and named.
 *
 * @param {string} moment
 * @param {string} zone such as `Europe/London`
 */
export function timeIn(moment, zone) {
  const date = new Date(moment);
  /** @type {Intl.DateTimeFormatOptions} */
  const minute = { hour: "2-digit", minute: "2-digit", hour12: false };
  try {
    return date.toLocaleTimeString("en-GB", { ...minute, timeZone: zone });
  } catch {
    return date.toLocaleTimeString("en-GB", { ...minute, timeZoneName: "short" });
  }
}

/**
 * The day in `zone`, as `2026-03-01`. If this browser does not know the zone, its own is used.
 *
 * @param {string} moment
 * @param {string} zone such as `Europe/London`
 */
export function dayIn(moment, zone) {
  // Swedish days are written as ISO 8601 has them.
  const date = new Date(moment);
  try {
    return date.toLocaleDateString("sv-SE", { timeZone: zone });
  } catch {
    return date.toLocaleDateString("sv-SE");
  }
}

/**
 * `1 comment`, `2 comments`.
 *
 * @param {number} count
 * @param {string} one
 * @param {string} [many]
 */
export function counted(count, one, many = `${one}s`) {
  return `${count} ${count === 1 ? one : many}`;
}
