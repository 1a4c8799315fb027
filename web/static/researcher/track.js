// The frames of a session's recordings on its timeline: which frame was on screen at a moment, and which ones follow.

/** @typedef {Pick<Api.RecordingCourse, "name" | "kind" | "from" | "times_ms">} Recording */

/** A frame is on screen until the next one, but for at most this many seconds. After that, nothing was recorded. */
const LONGEST = 1;

/** The frames of all recordings, in the order of their exposure. A frame is identified by its index in this order. */
export class Track {
  /** @type {{ seconds: number, recording: Recording, frame: number }[]} */
  #frames;
  /** For each frame, the first frame of what was recorded without a gap. @type {number[]} */
  #begun = [];

  /** @param {Recording[]} recordings */
  constructor(recordings) {
    const frames = recordings.flatMap((recording) =>
      recording.times_ms.map((ms, frame) => ({ seconds: recording.from + ms / 1000, recording, frame })),
    );
    this.#frames = frames.sort((a, b) => a.seconds - b.seconds);
    for (const [index, { seconds }] of this.#frames.entries()) {
      const isNext = index > 0 && seconds - this.secondsOf(index - 1) <= LONGEST;
      this.#begun.push(isNext ? this.begunAt(index - 1) : index);
    }
  }

  get length() {
    return this.#frames.length;
  }

  /**
   * When frame `index` was exposed, in seconds of the timeline. Beyond either end, the time of the nearest frame.
   *
   * @param {number} index
   */
  secondsOf(index) {
    const inside = Math.min(Math.max(index, 0), this.length - 1);
    return this.#frames[inside]?.seconds ?? 0;
  }

  /**
   * The recording of frame `index`, and the frame's index within that recording.
   *
   * @param {number} index
   */
  place(index) {
    return this.#frames[index];
  }

  /**
   * The index of the last frame exposed by `seconds`; -1 before the first.
   *
   * @param {number} seconds
   */
  before(seconds) {
    let from = 0;
    let to = this.length;
    while (from < to) {
      const middle = (from + to) >> 1;
      if (this.secondsOf(middle) <= seconds) from = middle + 1;
      else to = middle;
    }
    return from - 1;
  }

  /**
   * The index of the frame that was on screen at `seconds`; null if nothing was recorded then.
   *
   * @param {number} seconds
   */
  at(seconds) {
    const index = this.before(seconds);
    return index >= 0 && seconds - this.secondsOf(index) <= LONGEST ? index : null;
  }

  /**
   * The first frame of what was recorded without a gap up to frame `index`.
   *
   * @param {number} index
   */
  begunAt(index) {
    return this.#begun[index] ?? index;
  }

  /** Frames per second, from the median time between frames; 0 if there are fewer than two frames. */
  get rate() {
    const gaps = this.#frames.slice(1).map(({ seconds }, index) => seconds - this.secondsOf(index));
    const middle = gaps.sort((a, b) => a - b)[gaps.length >> 1];
    return middle ? 1 / middle : 0;
  }

  /** The spans of the timeline that were recorded. */
  spans() {
    /** @type {{ from: number, to: number }[]} */
    const spans = [];
    for (const { seconds } of this.#frames) {
      const last = spans.at(-1);
      if (last && seconds - last.to <= LONGEST) last.to = seconds;
      else spans.push({ from: seconds, to: seconds });
    }
    return spans;
  }
}
