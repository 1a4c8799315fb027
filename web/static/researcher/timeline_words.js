// Texts about the timeline.

import { counted, dayIn } from "../shared/text.js";

/** @typedef {Api.Timeline} Timeline */

/**
 * Describes the drawing for a screen reader.
 *
 * @param {Timeline} timeline
 * @param {boolean} withPath whether the focal path is drawn
 */
export function description(timeline, withPath) {
  const { settings, pauses, absences, choices, holds, comments, set_aside: setAside } = timeline;
  const parts = [counted(settings.length, "setting")];
  if (pauses.length > 0) parts.push(counted(pauses.length, "pause"));
  if (absences.length > 0) parts.push(`${counted(absences.length, "time")} without the surgeon’s tablet`);
  if (choices.length > 0) parts.push(counted(choices.length, "place pointed at", "places pointed at"));
  if (holds.length > 0) parts.push(`focus held ${counted(holds.length, "time")}`);
  if (setAside.length > 0) {
    parts.push(counted(setAside.length, "answer that does not count", "answers that do not count"));
  }
  parts.push(counted(comments.length, "comment"));

  const what = withPath ? "Focal power over time" : "Timeline";
  return `${what}: ${parts.join(", ")}. The comments follow as a list.`;
}

/** @param {Timeline["sights"][number]} sight */
export function sightWords({ width, height, per_second: rate }) {
  return `The surgeon saw ${width}×${height}, ${rate.toFixed(1)} pictures a second`;
}

/** @param {Timeline["choices"][number]} choice */
export function choiceWords({ x, y }) {
  if (x == null || y == null) return "Focus pointed at the centre";
  return `Focus pointed at ${x.toFixed(0)}, ${y.toFixed(0)}`;
}

/**
 * Says what the surgeon saw when a comment was made; empty if that is not known.
 *
 * @param {Pick<Api.TimelineComment, "picture_width" | "pictures_per_second">} comment
 */
export function seenWords({ picture_width: width, pictures_per_second: rate }) {
  if (width == null) return "";
  return rate == null ? `${width} px` : `${width} px, ${rate.toFixed(0)}/s`;
}

/**
 * @param {Api.TimelineComment} comment
 * @param {string} zone the time zone of the page
 */
export function commentWords(comment, zone) {
  const { kind, note, erased } = comment;
  // A voice comment can be read once it has a transcript. The transcript stays when the sound is erased.
  if (kind === "voice" && note) return erased ? `${note} (sound erased on ${dayIn(erased, zone)})` : note;
  if (erased) return `Erased on ${dayIn(erased, zone)}`;
  if (kind === "voice") return "Voice comment, not transcribed yet";
  return kind === "mark" ? "Marked this moment" : comment.text;
}

/**
 * Text about an answer that does not count: the answer, and why it does not count.
 *
 * @param {Pick<Api.SetAside, "value" | "counted" | "late">} answer
 */
export function setAsideWords({ value, counted, late }) {
  const why = late ? "arrived too late" : "another device gave a different answer later";
  const instead = counted == null ? "" : `; ${answerWords(counted)} counts`;
  return `${answerWords(value)} (${why}${instead})`;
}

/** @param {Api.AnswerValue} value a 0 among points means that the item was not answered */
function answerWords(value) {
  // Nobody gives an empty answer, so the text was erased.
  if (value === "") return "erased";
  return Array.isArray(value) ? value.map((part) => (part === 0 ? "–" : part)).join(", ") : String(value);
}

/**
 * Says what a surgeon's tablet may still hold; null if nothing can be outstanding.
 *
 * @param {Api.Outstanding | null | undefined} outstanding
 * @param {(moment: string) => string} timeOf formats a moment as a time of day
 */
export function outstandingWords(outstanding, timeOf) {
  if (!outstanding) return null;
  const { counts_until: until, devices } = outstanding;
  const sentences = [];
  if (until) sentences.push(`Comments and answers still on a tablet count until ${timeOf(until)}.`);
  if (devices > 0) {
    const tablets = devices === 1 ? "One tablet has" : `${devices} tablets have`;
    sentences.push(`${tablets} not confirmed since the end that everything was sent.`);
  }
  return sentences.join(" ");
}
