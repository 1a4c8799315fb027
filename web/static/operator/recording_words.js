// The texts about the recording and the disk.

const KB = 1e3;
const MB = 1e6;
const GB = 1e9;

/** @param {number} bytes */
export function amount(bytes) {
  if (bytes >= GB) return `${(bytes / GB).toFixed(1)} GB`;
  if (bytes >= MB) return `${Math.round(bytes / MB)} MB`;
  return `${Math.round(bytes / KB)} kB`;
}

/**
 * A length of time, rounded to a useful precision.
 *
 * @param {number} seconds
 */
export function lasting(seconds) {
  if (seconds < 60) return `${Math.round(seconds)} s`;
  const minutes = Math.round(seconds / 60);
  if (minutes < 60) return `${minutes} min`;
  const hours = Math.floor(minutes / 60);
  if (hours < 48) return `${hours} h ${minutes % 60} min`;
  return `${Math.round(hours / 24)} days`;
}

/**
 * Says what is being recorded, or that nothing is.
 *
 * @param {Api.RecordingStatus} status
 */
export function nowWords(status) {
  const { recording, by_protocol: byProtocol, seconds, frames, lost, bytes } = status;
  if (!recording) return "Nothing is being recorded.";

  const what = recording === "view" ? "the view" : "mosaics";
  const why = byProtocol ? ", as the protocol asks" : "";
  const loss = lost > 0 ? `, ${lost} lost` : "";
  const length = lasting(Math.floor(seconds ?? 0));
  return `Recording ${what}${why}: ${length}, ${frames} frames${loss}, ${amount(bytes)}.`;
}

/**
 * Says how much space the disk has and, while the rate is known, how long it will last.
 *
 * @param {Api.RecordingStatus} status
 */
export function diskWords(status) {
  const { seconds_left: left, bytes_per_second: rate, free_bytes: free, reserve_bytes: reserve } = status;
  if (typeof free !== "number") return "";

  const kept = `${amount(free)} free; the trial’s reserve is ${amount(reserve ?? 0)}`;
  if (typeof left !== "number" || typeof rate !== "number") return `The disk has ${kept}.`;
  return `The disk lasts for about ${lasting(left)} at ${amount(rate)} a second (${kept}).`;
}
