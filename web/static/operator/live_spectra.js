// Spectra at places of the live picture, outside sessions: a mode in which taps set places, and the panel below.

import { post, Refused } from "../shared/api.js";
import { byId, setText } from "../shared/dom.js";
import { cellsOf } from "../shared/fit.js";
import { Asking } from "../spectra/asking.js";
import { drawCircles, drawCross } from "../spectra/circles.js";
import { Cross } from "../spectra/cross.js";
import { Panel } from "../spectra/panel.js";
import { SAMPLES } from "../spectra/places.js";

/** @typedef {import("../spectra/cross.js").Cell} Cell */

/** The spectra are asked for this often, and after a failure. */
const AGAIN_MS = 250;
const FAILED_MS = 1000;

export class LiveSpectra {
  #panel = new Panel(() => this.#change());
  #cross = new Cross();
  #redraw;
  #asking = new Asking(() => this.#ask());
  /** Whether spectra may be seen: outside sessions. */
  #allowed = false;
  /** Whether taps set places. */
  #isChosen = false;
  /** What came with the latest picture. @type {Stream.Header | null} */
  #header = null;
  /** The place that the last tap set. @type {import("../spectra/places.js").Place | null} */
  #tapped = null;

  /** @param {import("../shared/viewer.js").Viewer} viewer */
  constructor(viewer) {
    setText(
      byId("spectra-hint"),
      "Tap up to five places in the picture. By keyboard, once the picture is focused: the arrow keys move a cross, " +
        "in smaller steps where it is zoomed, and Enter sets a place. Shift with an arrow moves the zoomed picture.",
    );
    this.#redraw = viewer.offer(this);
    byId("point-focus").onclick = () => this.#choose(false);
    byId("point-spectrum").onclick = () => this.#choose(true);
    byId("view").addEventListener("blur", () => this.#hideCross());
    for (const event of ["visibilitychange", "signed-in"]) {
      document.addEventListener(event, () => this.#askOn());
    }
  }

  /** @param {Api.OperatorView | null} session */
  follow(session) {
    this.#allowed = session === null;
    if (!this.#allowed) this.#end();
    this.#show();
  }

  /**
   * A picture is shown.
   *
   * @param {Stream.Header} header
   */
  see(header) {
    const before = this.#header;
    this.#header = header;
    if (before?.estimated !== header.estimated) this.#show();
  }

  get isTaken() {
    return this.#isChosen && this.#isOffered;
  }

  get hasMarks() {
    return this.#isOffered && (this.#cross.at !== null || this.#panel.places.all.length > 0);
  }

  /** @param {Cell} cell */
  tap(cell) {
    this.#cross.hide();
    this.#tapped = this.#set(cell);
  }

  takeBack() {
    if (this.#tapped) this.#panel.remove(this.#tapped);
    this.#tapped = null;
  }

  /**
   * @param {number} dx
   * @param {number} dy
   */
  move(dx, dy) {
    const cells = this.#cells;
    if (cells) this.#cross.move(dx, dy, cells);
    this.#redraw();
  }

  set() {
    if (this.#cross.at) this.#set(this.#cross.at);
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {number} pixels
   * @param {number} line
   */
  draw(context, pixels, line) {
    drawCircles(context, this.#panel.places, pixels, line);
    if (this.#cross.at) drawCross(context, this.#cross.at, pixels, line);
  }

  /** Whether there are spectra to see: the colours of a camera without bands are not estimated from any. */
  get #isOffered() {
    return this.#allowed && this.#header?.estimated === true;
  }

  /** The picture's extent in mosaic cells; null before the first. */
  get #cells() {
    return this.#header && cellsOf(this.#header);
  }

  /** @param {boolean} spectrum */
  #choose(spectrum) {
    this.#isChosen = spectrum;
    this.#cross.hide();
    this.#show();
  }

  #end() {
    this.#isChosen = false;
    this.#tapped = null;
    this.#cross.hide();
    if (this.#panel.places.all.length > 0) this.#panel.clear();
  }

  #hideCross() {
    this.#cross.hide();
    this.#redraw();
  }

  #show() {
    byId("point-modes").hidden = !this.#isOffered;
    byId("point-focus").setAttribute("aria-pressed", String(!this.#isChosen));
    byId("point-spectrum").setAttribute("aria-pressed", String(this.#isChosen));
    const hasPlaces = this.#panel.places.all.length > 0;
    byId("spectra").hidden = !(this.#isOffered && (this.#isChosen || hasPlaces));
    this.#redraw();
  }

  /** @param {Cell} cell */
  #set({ x, y }) {
    const cells = this.#cells;
    if (!cells || x < 0 || y < 0 || x >= cells.width || y >= cells.height) return null;
    return this.#panel.add({ x: x * SAMPLES, y: y * SAMPLES });
  }

  #change() {
    this.#show();
    this.#askOn();
  }

  /** @param {number} [ms] */
  #askOn(ms) {
    // Nobody looks at a hidden page.
    const wanted = this.#isOffered && this.#panel.places.all.length > 0 && !document.hidden;
    if (wanted) this.#asking.want(ms);
    else this.#asking.stop();
  }

  async #ask() {
    const { all, radius } = this.#panel.places;
    try {
      const places = all.map(({ x, y }) => ({ x, y, radius }));
      const { frame, spectra } = await post("/api/operator/spectra", { places });
      const measured = all.flatMap((place, index) => {
        const spectrum = spectra[index];
        return spectrum ? [{ place, radius, spectrum }] : [];
      });
      this.#panel.show(frame, measured);
      this.#askOn(AGAIN_MS);
    } catch (error) {
      this.#panel.tellTrouble(error);
      // Asked again at once, the server would ask to sign in every second.
      if (!(error instanceof Refused && error.needsSignIn)) this.#askOn(FAILED_MS);
    }
  }
}
