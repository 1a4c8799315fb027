// Plays a session's recordings below its timeline: the picture, the buttons, the keyboard.

import { getPicture, inWords, Refused } from "../shared/api.js";
import { byId, make, setText } from "../shared/dom.js";
import { Pictures } from "./pictures.js";
import { PlayerSpectra } from "./player_spectra.js";
import { chosenPatchAt, DAMAGED, momentText, valuesAt, whyNoPicture } from "./player_words.js";
import { Playhead } from "./playhead.js";
import { lengthOf } from "./timeline.js";
import { Track } from "./track.js";

/** How many pictures are requested ahead of playback: one second at 25 pictures a second. */
const AHEAD = 25;

/** Playback begins this many seconds before a comment, because the surgeon saw its subject before commenting. */
const BEFORE_COMMENT = 3;

/** Elements that need the keys for themselves. */
const TYPING = "input:not(#player-scrub), textarea, select, dialog, audio";

export class Player {
  #session;
  #timeline;
  #policies;
  #moved;

  #track;
  #playhead;
  /** @type {Pictures<ImageBitmap>} */
  #pictures;
  /** @type {import("./player_spectra.js").Size} */
  #size = "cell";
  #spectra;
  /** The frame on the canvas. @type {number | null} */
  #drawn = null;
  /** When playback last moved the playhead, in milliseconds; null while it is paused. @type {number | null} */
  #movedAt = null;

  #canvas = byId("player-picture", HTMLCanvasElement);
  #scrub = byId("player-scrub", HTMLInputElement);
  #play = byId("player-play", HTMLButtonElement);

  /**
   * @param {object} options
   * @param {string} options.session
   * @param {Api.Timeline} options.timeline
   * @param {string[]} options.policies the policy of each setting
   * @param {Api.RecordingCourse[]} options.recordings at least one
   * @param {(seconds: number, playing: boolean) => void} options.moved called when the playhead has moved
   */
  constructor({ session, timeline, policies, recordings, moved }) {
    this.#session = session;
    this.#timeline = timeline;
    this.#policies = policies;
    this.#moved = moved;
    this.#track = new Track(recordings);
    this.#playhead = new Playhead(this.#track);
    this.#pictures = new Pictures({
      load: (frame, signal) => this.#load(frame, signal),
      explain: whyNoPicture,
      arrived: (frame) => this.#arrived(frame),
      failed: (error) => this.#failed(error),
    });

    this.#spectra = new PlayerSpectra(session, this.#canvas);
    this.#scrub.max = String(lengthOf(timeline, this.spans));
    byId("player").hidden = false;
    const hasMosaics = recordings.some(({ kind }) => kind === "mosaic");
    byId("player-sizes").hidden = !hasMosaics;
    byId("spectra").hidden = !hasMosaics;
    this.#listen();
    this.#show();
  }

  /** The spans of time that were recorded. */
  get spans() {
    return this.#track.spans();
  }

  /** Where the playhead is, in seconds of the timeline. */
  get seconds() {
    return this.#playhead.seconds;
  }

  /** @param {number} seconds */
  seek(seconds) {
    this.#playhead.seek(seconds);
    this.#show();
  }

  /**
   * Plays from a little before `seconds`, the time of a comment.
   *
   * @param {number} seconds
   */
  playBefore(seconds) {
    this.#playhead.seek(Math.max(seconds - BEFORE_COMMENT, 0));
    this.#start();
    byId("player").scrollIntoView({ block: "nearest" });
  }

  #listen() {
    this.#play.onclick = () => this.#toggle();
    byId("player-back").onclick = () => this.#step(-1);
    byId("player-forward").onclick = () => this.#step(1);
    this.#scrub.oninput = () => this.seek(this.#scrub.valueAsNumber);

    const speed = byId("player-speed", HTMLSelectElement);
    speed.onchange = () => {
      this.#playhead.speed = Number(speed.value);
      this.#ask();
    };
    const size = byId("player-size", HTMLSelectElement);
    size.onchange = () => {
      this.#size = size.value === "half" ? "half" : "cell";
      this.#drawn = null;
      this.#pictures.clear();
      this.#show();
    };
    document.addEventListener("keydown", (event) => this.#key(event));
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const target = event.target instanceof Element ? event.target : document.body;
    const plain = !(event.altKey || event.ctrlKey || event.metaKey || event.shiftKey);
    if (!plain || event.defaultPrevented || target.closest(TYPING)) return;

    if (event.key === "ArrowLeft") this.#step(-1);
    else if (event.key === "ArrowRight") this.#step(1);
    // On a button, a link or a line that unfolds something the space bar has its usual effect.
    else if (event.key === " " && !target.closest("button, a, summary")) this.#toggle();
    else return;
    event.preventDefault();
  }

  #toggle() {
    if (this.#playhead.playing) {
      this.#playhead.pause();
      this.#show();
    } else {
      this.#playhead.play();
      this.#start();
    }
  }

  #start() {
    this.#playhead.playing = true;
    setText(byId("player-trouble"), "");
    this.#show();
    if (this.#movedAt === null) requestAnimationFrame((now) => this.#begin(now));
  }

  /** @param {number} now milliseconds */
  #begin(now) {
    this.#movedAt = now;
    requestAnimationFrame((later) => this.#tick(later));
  }

  /** @param {number} now milliseconds */
  #tick(now) {
    if (!this.#playhead.playing) {
      this.#movedAt = null;
      return;
    }
    // After a long gap, for example while the page was hidden, playback continues where it was.
    const elapsed = Math.min((now - (this.#movedAt ?? now)) / 1000, 0.25);
    this.#movedAt = now;
    this.#playhead.advance(elapsed, (frame) => this.#pictures.get(frame) !== undefined);
    this.#show();
    requestAnimationFrame((later) => this.#tick(later));
  }

  /** @param {number} count */
  #step(count) {
    this.#playhead.step(count);
    this.#show();
  }

  #show() {
    this.#ask();
    this.#tell();
  }

  /** Draws everything that changes with the playhead. */
  #tell() {
    const { seconds, playing, waiting } = this.#playhead;
    this.#draw();

    setText(this.#play, playing ? "Pause" : "Play");
    this.#scrub.value = String(seconds);
    this.#scrub.setAttribute("aria-valuetext", momentText(seconds));
    setText(byId("player-time"), momentText(seconds));
    setText(byId("player-waiting"), playing && waiting ? "Waiting for pictures…" : "");
    this.#tellValues(seconds);
    this.#moved(seconds, playing);
  }

  /** @param {number} seconds */
  #tellValues(seconds) {
    const rows = valuesAt(this.#timeline, this.#policies, seconds);
    const list = byId("player-values");
    if (list.childElementCount !== 2 * rows.length) {
      list.replaceChildren(...rows.flatMap(([name]) => [make("dt", {}, name), make("dd")]));
    }
    for (const [index, [, value]] of rows.entries()) {
      const cell = list.children[2 * index + 1];
      if (cell instanceof HTMLElement) setText(cell, value);
    }
  }

  #ask() {
    this.#pictures.want(this.#playhead.needed(AHEAD));
  }

  /** @param {number} frame */
  #arrived(frame) {
    setText(byId("player-trouble"), "");
    if (frame === this.#playhead.frame) this.#draw();
  }

  #draw() {
    const frame = this.#playhead.frame;
    this.#canvas.classList.toggle("elsewhere", frame === null);
    if (frame === null) {
      // Otherwise the spectra would not follow when the same frame is shown again.
      this.#drawn = null;
      this.#say("Nothing was recorded at this time.");
      this.#spectra.follow(null);
      return;
    }

    const arrived = this.#pictures.get(frame);
    if (!arrived) return;
    this.#say(arrived.problem ? `This frame cannot be shown: ${arrived.problem}` : "");
    if (!arrived.picture || frame === this.#drawn) return;

    this.#drawn = frame;
    const { picture } = arrived;
    if (this.#canvas.width !== picture.width) this.#canvas.width = picture.width;
    if (this.#canvas.height !== picture.height) this.#canvas.height = picture.height;
    this.#canvas.getContext("2d", { alpha: false })?.drawImage(picture, 0, 0);
    this.#canvas.dataset.frame = String(frame);

    const place = this.#track.place(frame);
    if (!place) return;
    const patch = chosenPatchAt(this.#timeline, place.seconds);
    this.#spectra.follow({ ...place, size: this.#size, patch, playing: this.#playhead.playing });
  }

  /** @param {string} text */
  #say(text) {
    setText(byId("player-note"), text);
  }

  /**
   * @param {number} frame
   * @param {AbortSignal} signal
   */
  async #load(frame, signal) {
    const place = this.#track.place(frame);
    const names = {
      session: this.#session,
      recording: place?.recording.name ?? "",
      frame: String(place?.frame ?? 0),
    };
    const path = "/api/researcher/sessions/{session}/recordings/{recording}/frames/{frame}";
    const jpeg = await getPicture(path, names, { size: this.#size }, signal);
    try {
      return await createImageBitmap(jpeg);
    } catch {
      throw new Refused(DAMAGED, "its picture is damaged.", true);
    }
  }

  /** @param {unknown} error */
  #failed(error) {
    this.#playhead.pause();
    setText(byId("player-trouble"), inWords(error));
    // Asks for no pictures: each failure would request the others again, for as long as the server is silent.
    this.#tell();
  }
}
