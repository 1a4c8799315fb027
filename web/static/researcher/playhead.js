// Where playback is on the timeline, and how it moves. It never moves past a picture that has not arrived yet.

/** Nobody can distinguish more pictures per second than this. Faster playback leaves frames out. */
const MOST_A_SECOND = 30;

/** @typedef {import("./track.js").Track} Track */

export class Playhead {
  /** Position on the timeline, in seconds. */
  seconds;
  playing = false;
  /** Seconds of the timeline that pass in one second. */
  speed = 1;
  /** Whether it waits for a picture. */
  waiting = false;

  #track;
  /** Frames per second of the recording. Kept here because computing it takes a while. */
  #rate;

  /** @param {Track} track must have at least one frame */
  constructor(track) {
    this.#track = track;
    this.#rate = track.rate;
    this.seconds = track.secondsOf(0);
  }

  /** The frame to show; null if nothing was recorded at this moment. */
  get frame() {
    return this.#track.at(this.seconds);
  }

  /** Starts to play. If the end was reached, it starts again from the beginning. */
  play() {
    if (this.#track.before(this.seconds) === this.#track.length - 1) this.seconds = this.#track.secondsOf(0);
    this.playing = true;
  }

  pause() {
    this.playing = false;
    this.waiting = false;
  }

  /** @param {number} seconds */
  seek(seconds) {
    this.seconds = seconds;
  }

  /**
   * Moves `count` frames forward, or backward if it is negative, and pauses.
   *
   * @param {number} count
   */
  step(count) {
    this.pause();
    const here = this.#track.before(this.seconds);
    // Between two recordings, one step back leads to the last frame of the earlier one.
    const from = count < 0 && this.frame === null ? here + 1 : here;
    this.seconds = this.#track.secondsOf(from + count);
  }

  /**
   * Moves on by `elapsed` seconds of playing. It skips gaps, and goes no further than the last frame whose picture is
   * there.
   *
   * @param {number} elapsed
   * @param {(frame: number) => boolean} isThere whether a frame's picture has arrived
   */
  advance(elapsed, isThere) {
    const track = this.#track;
    const here = track.before(this.seconds);
    let target = this.seconds + elapsed * this.speed;
    if (track.at(target) === null) {
      const next = track.before(target) + 1;
      target = next < track.length ? track.secondsOf(next) : track.secondsOf(track.length - 1);
    }

    const wanted = track.before(target);
    let reached = wanted;
    while (reached > here && !isThere(reached)) reached -= 1;

    this.waiting = reached < wanted;
    if (reached === wanted) this.seconds = Math.max(this.seconds, target);
    else if (reached > here) this.seconds = track.secondsOf(reached);

    if (!this.waiting && wanted >= track.length - 1) {
      this.seconds = track.secondsOf(track.length - 1);
      this.pause();
    }
  }

  /**
   * The frames whose pictures are needed now and next, at most `count`.
   *
   * @param {number} count
   */
  needed(count) {
    const apart = Math.max(1, Math.round((this.speed * this.#rate) / MOST_A_SECOND));
    const first = Math.max(this.#track.before(this.seconds), 0);
    const frames = [first];
    if (this.frame === null && first + 1 < this.#track.length) frames.push(first + 1);

    const step = this.playing ? apart : 1;
    for (let next = first + step; next < this.#track.length && frames.length < count; next += step) {
      if (!frames.includes(next)) frames.push(next);
    }
    // While playback is paused, a step back is as likely as a step forward.
    if (!this.playing && first > 0) frames.splice(2, 0, first - 1);
    return frames.slice(0, count);
  }
}
