// Voice comments on the researcher's page: their player, and a text about their state.

import { make } from "../shared/dom.js";
import { clockText, counted } from "../shared/text.js";

/**
 * The player of a voice comment, or only its state if no sound is there; null for other comments.
 *
 * @param {string} session
 * @param {Api.TimelineComment} comment
 */
export function voicePlayer(session, { key, voice, erased }) {
  if (!voice) return null;
  const state = make("span", { className: "muted" }, voiceWords(voice));
  if (erased || !voice.media_type) return make("span", { className: "voice" }, state);

  const audio = make("audio", {
    controls: true,
    preload: "none",
    src: `/api/researcher/sessions/${session}/voice/${key}`,
    "aria-label": "The recording of this comment",
  });
  return make("span", { className: "voice" }, audio, state);
}

/**
 * Says how long a recording is, and whether all of it is there.
 *
 * @param {NonNullable<Api.TimelineComment["voice"]>} voice
 */
export function voiceWords({ media_type: type, seconds, ended, missing }) {
  if (!type) return "Nothing of the recording has arrived";
  const parts = [clockText(seconds, Math.round)];
  if (missing > 0) parts.push(counted(missing, "second is missing", "seconds are missing"));
  if (!ended) parts.push("cut off");
  if (ended === "limit") parts.push("ended after two minutes");
  if (ended === "microphone-lost") parts.push("ended because the microphone was taken away");
  if (ended === "left") parts.push("ended because the page went out of sight");
  return parts.join(", ");
}
