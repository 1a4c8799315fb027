// What is tried on a tablet, in words.

import { say, sayAttribute } from "../shared/language.js";

/** @typedef {Api.Schemas["TabletPart"]} Part */
/** @typedef {{ part: Part, works: boolean }} Tried */

/** The message about each part: its name, and as `advice` what to do if it does not work. @type {Record<Part, string>} */
export const PARTS = {
  encrypted: "tablet-encrypted",
  storage: "tablet-storage",
  disk: "tablet-disk",
  stream: "tablet-stream",
  picture: "tablet-picture",
  microphone: "tablet-microphone",
  "screen-on": "tablet-screen-on",
};

/**
 * @param {Part} part
 * @param {boolean} works
 */
export function partWords(part, works) {
  const id = PARTS[part];
  if (works) return say("tablet-works", { part: say(id) });
  return say("tablet-fails", { part: say(id), advice: sayAttribute(id, "advice") });
}

/** What a trial cannot do without. @type {Part[]} */
const NEEDED = ["storage", "stream", "picture"];

/** @param {Tried[]} tried */
export function summary(tried) {
  const missing = tried.filter(({ works }) => !works).map(({ part }) => part);
  if (missing.length === 0) return say("tablet-all-works");
  if (missing.some((part) => NEEDED.includes(part))) return say("tablet-unfit");
  return say("tablet-mostly");
}
