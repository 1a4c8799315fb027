// Where playback is on the timeline, and how it moves. It never moves past a picture that has not arrived yet.

/** Nobody can distinguish more pictures per second than this. Faster playback leaves frames out. */
const MOST_A_SECOND = 30;

/** @typedef {import("./track.js").Track} Track */

export class Playhead {
  /** Position on the timeline, in seconds. */
  seconds;
  playing = false;
  /** Whether it waits for a picture. */
  waiting = false;

  #track;
  /** Frames per second of the recording. Kept here because computing it takes a while. */
  #rate;
  #speed = 1;
  /**
   * The frame from which playing counts. While it plays, only every `#apart`th frame from here on is wanted, waited for
   * and drawn. It must not follow the position, or every step would want other frames than the step before.
   */
  #origin = 0;

  /** @param {Track} track must have at least one frame */
  constructor(track) {
    this.#track = track;
    this.#rate = track.rate;
    this.seconds = track.secondsOf(0);
  }

  /** Seconds of the timeline that pass in one second. */
  get speed() {
    return this.#speed;
  }

  set speed(speed) {
    // From the frame that is on screen, so that the picture does not jump.
    this.#origin = this.#played(this.#track.before(this.seconds));
    this.#speed = speed;
  }

  /** The frame to show; null if nothing was recorded at this moment. */
  get frame() {
    const frame = this.#track.at(this.seconds);
    return frame !== null && this.playing ? this.#played(frame) : frame;
  }

  /** Starts to play. If the end was reached, it starts again from the beginning. */
  play() {
    const here = this.#track.before(this.seconds);
    if (here === this.#track.length - 1) this.seek(this.#track.secondsOf(0));
    else this.#origin = here;
    this.playing = true;
  }

  pause() {
    this.playing = false;
    this.waiting = false;
  }

  /** @param {number} seconds */
  seek(seconds) {
    this.seconds = seconds;
    this.#origin = this.#track.before(seconds);
  }

  /**
   * Moves `count` frames forward, or backward if it is negative, and pauses.
   *
   * @param {number} count
   */
  step(count) {
    // What is on screen may be a little behind the position.
    const shown = this.frame;
    this.pause();
    const here = shown ?? this.#track.before(this.seconds);
    // Between two recordings, one step back leads to the last frame of the earlier one.
    const from = count < 0 && shown === null ? here + 1 : here;
    this.seek(this.#track.secondsOf(from + count));
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
    const here = this.#played(track.before(this.seconds));
    let target = this.seconds + elapsed * this.#speed;
    if (track.at(target) === null) {
      const next = track.before(target) + 1;
      target = next < track.length ? track.secondsOf(next) : track.secondsOf(track.length - 1);
    }

    const wanted = this.#played(track.before(target));
    let reached = wanted;
    while (reached > here && !isThere(reached)) reached = this.#played(reached - 1);

    this.waiting = reached < wanted || !isThere(reached);
    if (!this.waiting) this.seconds = Math.max(this.seconds, target);
    else if (reached > here) this.seconds = track.secondsOf(reached);

    if (!this.waiting && target >= track.secondsOf(track.length - 1)) {
      this.seek(track.secondsOf(track.length - 1));
      this.pause();
    }
  }

  /**
   * The frames whose pictures are needed now and next, at most `count`.
   *
   * @param {number} count
   */
  needed(count) {
    return this.playing ? this.#neededToPlay(count) : this.#neededAround(count);
  }

  /** @param {number} count */
  #neededToPlay(count) {
    const frames = [];
    let next = Math.max(this.#played(this.#track.before(this.seconds)), 0);
    while (next < this.#track.length && frames.length < count) {
      frames.push(next);
      next = this.#playedAfter(next);
    }
    return frames;
  }

  /**
   * While playback is paused, a step back is as likely as a step forward.
   *
   * @param {number} count
   */
  #neededAround(count) {
    const first = Math.max(this.#track.before(this.seconds), 0);
    const frames = [first, first + 1, first - 1];
    for (let next = first + 2; frames.length < count + 2; next += 1) frames.push(next);
    return frames.filter((frame) => frame >= 0 && frame < this.#track.length).slice(0, count);
  }

  /** How many frames playing goes on at once. */
  get #apart() {
    return Math.max(1, Math.round((this.#speed * this.#rate) / MOST_A_SECOND));
  }

  /**
   * The frame that stands for `frame` while it plays: the last one, up to `frame`, that playing wants. After a gap it
   * counts anew, from the first frame recorded there.
   *
   * @param {number} frame -1 before the first
   */
  #played(frame) {
    if (frame < 0) return frame;
    const begun = this.#track.begunAt(frame);
    const from = this.#origin > frame ? begun : Math.max(begun, this.#origin);
    return from + Math.floor((frame - from) / this.#apart) * this.#apart;
  }

  /** @param {number} frame one that playing wants; the result is the next one */
  #playedAfter(frame) {
    for (let next = frame + 1; next < frame + this.#apart; next += 1) {
      if (this.#played(next) === next) return next;
    }
    return frame + this.#apart;
  }
}
