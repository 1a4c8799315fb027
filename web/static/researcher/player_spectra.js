// What the player shows on and beside its picture: the corners of the patch that somebody had chosen, and the spectra
// at places that the researcher sets. The spectra follow the frame on screen.

import { get } from "../shared/api.js";
import { contextOf, onResize, pixelsPerCss } from "../shared/canvas.js";
import { byId, setText } from "../shared/dom.js";
import { drawPatch } from "../shared/overlay.js";
import { Asking } from "../spectra/asking.js";
import { drawCircles, drawCross } from "../spectra/circles.js";
import { Cross } from "../spectra/cross.js";
import { Panel } from "../spectra/panel.js";
import { SAMPLES } from "../spectra/places.js";

/** @typedef {"cell" | "half"} Size */

/**
 * The frame on screen.
 *
 * @typedef {object} Shown
 * @property {import("./track.js").Recording} recording
 * @property {number} frame within the recording
 * @property {Size} size of the picture
 * @property {Stream.Patch | null} patch null unless somebody had chosen its place
 * @property {boolean} playing
 */

/** Pixels of a mosaic's picture along each side of a cell. */
const PER_CELL = { cell: 1, half: 2 };

/** While it plays, spectra are asked for this often. The pictures come first. */
const PLAYING_MS = 150;

/** An arrow key moves the cross by this many pixels of the page; with Shift by one cell. */
const STEP = 8;

/** @type {Record<string, [number, number]>} */
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class PlayerSpectra {
  #session;
  #picture;
  #stage = byId("player-stage");
  #marks = contextOf(byId("player-marks", HTMLCanvasElement));
  #cross = new Cross();
  #panel = new Panel(() => this.#change());
  #asking = new Asking(() => this.#ask());
  /** @type {Shown | null} */
  #shown = null;

  /**
   * @param {string} session
   * @param {HTMLCanvasElement} picture
   */
  constructor(session, picture) {
    this.#session = session;
    this.#picture = picture;
    setText(
      byId("spectra-hint"),
      "Touch up to five places in the picture. By keyboard, once the picture is focused: the arrow keys move a cross, " +
        "with Shift in the smallest steps, and Enter sets a place.",
    );
    onResize(this.#marks.canvas, () => this.#draw());
    this.#listen();
  }

  /**
   * Follows the picture on screen; null while there is none.
   *
   * @param {Shown | null} shown
   */
  follow(shown) {
    this.#shown = shown;
    this.#draw();
    if (shown && this.#panel.places.all.length > 0) this.#asking.want(shown.playing ? PLAYING_MS : 0);
  }

  #listen() {
    const stage = this.#stage;
    // A click leaves the focus where it is, so that the arrow keys still go from frame to frame.
    stage.addEventListener("mousedown", (event) => event.preventDefault());
    stage.addEventListener("click", (event) => {
      const box = stage.getBoundingClientRect();
      const { left, top, scale } = this.#framing;
      this.#cross.hide();
      this.#set({ x: (event.clientX - box.left - left) / scale, y: (event.clientY - box.top - top) / scale });
    });
    stage.addEventListener("keydown", (event) => this.#key(event));
    stage.addEventListener("blur", () => {
      this.#cross.hide();
      this.#draw();
    });
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    if (event.altKey || event.ctrlKey || event.metaKey || !this.#hasBands) return;
    const arrow = ARROWS[event.key];
    if (arrow) {
      const step = event.shiftKey ? 1 : STEP / this.#framing.scale;
      this.#cross.move(arrow[0] * step, arrow[1] * step, this.#cells);
    } else if (event.key === "Enter" && this.#cross.at) {
      this.#set(this.#cross.at);
    } else return;
    // The player would go to another frame.
    event.preventDefault();
    this.#draw();
  }

  /** Whether the frame on screen is a mosaic. */
  get #hasBands() {
    return this.#shown?.recording.kind === "mosaic";
  }

  /** The picture's extent in cells. */
  get #cells() {
    const perCell = PER_CELL[this.#shown?.size ?? "cell"];
    return { width: this.#picture.width / perCell, height: this.#picture.height / perCell };
  }

  /** Where the picture is in its box, and CSS pixels per cell. */
  get #framing() {
    const { width, height } = this.#cells;
    const box = { width: this.#stage.clientWidth, height: this.#stage.clientHeight };
    const scale = Math.min(box.width / width, box.height / height);
    return { left: (box.width - width * scale) / 2, top: (box.height - height * scale) / 2, scale };
  }

  /** @param {{ x: number, y: number }} cell */
  #set({ x, y }) {
    const { width, height } = this.#cells;
    if (!this.#shown || x < 0 || y < 0 || x >= width || y >= height) return;
    if (this.#hasBands) this.#panel.add({ x: x * SAMPLES, y: y * SAMPLES });
    else this.#panel.tell("This is a recording of the view. It has no spectra, only colours.");
  }

  #change() {
    this.#draw();
    if (this.#panel.places.all.length > 0) this.#asking.want();
    else this.#asking.stop();
  }

  async #ask() {
    const shown = this.#shown;
    if (shown?.recording.kind !== "mosaic") return;
    const { all, radius } = this.#panel.places;
    try {
      const path = "/api/researcher/sessions/{session}/recordings/{recording}/frames/{frame}/spectrum";
      const names = { session: this.#session, recording: shown.recording.name, frame: String(shown.frame) };
      const asked = all.map(async (place) => {
        const query = { x: String(place.x), y: String(place.y), radius: String(radius) };
        return { place, radius, spectrum: await get(path, names, query) };
      });
      this.#panel.show(shown.frame, await Promise.all(asked));
    } catch (error) {
      this.#panel.tellTrouble(error);
    }
  }

  #draw() {
    const { canvas } = this.#marks;
    this.#marks.resetTransform();
    this.#marks.clearRect(0, 0, canvas.width, canvas.height);
    // A picture of the view has no known size in cells.
    if (!this.#hasBands) return;

    const density = pixelsPerCss(canvas);
    const { left, top, scale } = this.#framing;
    const line = 1.5 * density;
    this.#marks.translate(left * density, top * density);
    if (this.#shown?.patch) drawPatch(this.#marks, this.#shown.patch, scale * density, line);
    drawCircles(this.#marks, this.#panel.places, scale * density, line);
    if (this.#cross.at) drawCross(this.#marks, this.#cross.at, scale * density, line);
  }
}
