// The live view: the picture, the overlays on it, and how old it is.

import { makeCanvas, onResize, pixelsPerCss } from "./canvas.js";
import { make, setText } from "./dom.js";
import { cellsOf, Fit } from "./fit.js";
import { Framing } from "./framing.js";
import { say } from "./language.js";
import { Live } from "./live.js";
import { drawContentArea, drawPatch, drawRing, Peaking } from "./overlay.js";
import { Pointing } from "./pointing.js";
import { followZooming } from "./zooming.js";

/** A picture older than this is no longer live. */
const STALE_MS = 500;
const LOOK_MS = 250;

/** A key moves a tool's cross by this many pixels of the page. So zooming makes it finer. */
const TOOL_STEP = 8;

/**
 * Draws a page's own overlay. `pixels` is screen pixels per mosaic cell, `line` a line's width in screen pixels.
 *
 * @typedef {(context: CanvasRenderingContext2D, header: Stream.Header, pixels: number, line: number) => void} Draw
 */

/**
 * What can take the taps and keys that point, in place of pointing at what is to be in focus, and draws on the picture.
 * Places are in mosaic cells.
 *
 * @typedef {object} Tool
 * @property {boolean} isTaken whether it takes them now
 * @property {boolean} hasMarks whether it has anything to draw
 * @property {(cell: import("./framing.js").Point) => void} tap
 * @property {() => void} takeBack the last tap has become the first of a double tap
 * @property {(dx: number, dy: number) => void} move a key moves its cross by so many cells
 * @property {() => void} set a key sets the cross
 * @property {(context: CanvasRenderingContext2D, pixels: number, line: number) => void} draw `pixels` is screen pixels
 *   per cell
 */

/** A live view within an element, which must be positioned and have a size of its own. */
export class Viewer {
  /** The live connection. It also brings the session's view and the devices' state. */
  live;

  #element;
  #picture = makeCanvas("viewer-picture", { alpha: false });
  #overlay = makeCanvas("viewer-overlay");
  #stale = make("p", { className: "viewer-stale", "aria-hidden": "true" });
  #heard = make("p", { className: "viewer-heard visually-hidden", role: "status" });
  /** Says that the colours are estimated. It stands beside the view, because over it lies tissue. */
  #colour;
  #unzoom = make("button", { type: "button", className: "viewer-unzoom", hidden: true });
  #fit = new Fit({ glides: !matchMedia("(prefers-reduced-motion: reduce)").matches });
  #framing = new Framing();
  #lookAtScreen;
  /** @type {Set<string>} */
  #shown = new Set();
  #peaking = new Peaking();
  /** The page's own overlays, by name. @type {Map<string, Draw>} */
  #own = new Map();
  #isOverlayClear = true;
  /** @type {{ header: Stream.Header, receivedAt: number } | null} */
  #last = null;
  #connected = false;
  #ended = false;
  /** @type {import("./pointing.js").Pointing | null} */
  #pointing = null;
  /** @type {Tool | null} */
  #tool = null;

  /**
   * @param {HTMLElement} element
   * @param {"surgeon" | "operator" | "researcher"} role
   * @param {HTMLElement} colour shown while the colours are estimated
   */
  constructor(element, role, colour) {
    this.#element = element;
    this.#colour = colour;
    this.#picture.canvas.setAttribute("role", "img");
    element.append(this.#picture.canvas, this.#overlay.canvas, this.#unzoom, this.#stale, this.#heard);
    element.tabIndex = 0;
    element.setAttribute("role", "group");
    this.drawWords();

    this.#lookAtScreen = onResize(this.#overlay.canvas, () => {
      const { canvas } = this.#overlay;
      const box = { width: canvas.clientWidth, height: canvas.clientHeight };
      this.#framing.resize(box, pixelsPerCss(canvas));
      this.#place();
    });
    followZooming(element, this.#framing, () => this.#place(), {
      tap: (point) => (this.#takenTool ?? this.#pointing)?.tap(this.#cellAt(point)),
      takeBack: () => (this.#takenTool ?? this.#pointing)?.takeBack(),
      nudge: (across, down) => {
        const step = TOOL_STEP / this.#framing.place.scale;
        if (this.#takenTool) this.#takenTool.move(across * step, down * step);
        else this.#pointing?.nudge(across, down);
      },
      centre: () => this.#pointing?.centre(),
      set: () => this.#takenTool?.set(),
      takesArrows: () => this.#takenTool !== null,
    });
    this.#unzoom.onclick = () => {
      this.#framing.reset();
      this.#place();
      element.focus({ preventScroll: true });
    };

    this.live = new Live(role);
    this.live.listen({
      frame: (frame) => this.#show(frame),
      connection: (open) => {
        this.#connected = open;
        this.#tellAge();
      },
    });
    setInterval(() => this.#tellAge(), LOOK_MS);
    this.#tellAge();
  }

  /** Number of the frame on screen; null before the first. */
  get frame() {
    return this.#last?.header.frame ?? null;
  }

  /** The server's run that the number `frame` belongs to; null before the first frame. */
  get run() {
    return this.#last?.header.run ?? null;
  }

  /** Milliseconds since the picture on screen was exposed, its way to this page included; null before the first. */
  get age() {
    if (!this.#last) return null;
    const { header, receivedAt } = this.#last;
    return header.age + header.travel + performance.now() - receivedAt;
  }

  /**
   * Adds an overlay of the page's own, drawn below the patch.
   *
   * @param {string} name
   * @param {Draw} draw
   */
  addOverlay(name, draw) {
    this.#own.set(name, draw);
  }

  /**
   * Switches an overlay on or off.
   *
   * @param {string} name `patch`, `content-area`, `peaking`, or one that the page has added
   * @param {boolean} on
   */
  overlay(name, on) {
    if (on) this.#shown.add(name);
    else this.#shown.delete(name);
    this.#drawOverlays();
  }

  /**
   * Lets people point at the picture.
   *
   * @param {import("./pointing.js").Parts["send"]} send
   * @param {import("./pointing.js").Parts["report"]} report
   */
  pointBy(send, report) {
    this.#pointing = new Pointing({
      send,
      report,
      later: (run, ms) => {
        const timer = setTimeout(run, ms);
        return () => clearTimeout(timer);
      },
      now: () => performance.now(),
      changed: () => this.#drawOverlays(),
      whyNot: () => (this.#isStale ? say("not-pointed-live") : ""),
    });
    this.drawWords();
    return this.#pointing;
  }

  /**
   * Offers `tool` what people do with the picture. Call the returned function when its marks have changed.
   *
   * @param {Tool} tool
   */
  offer(tool) {
    this.#tool = tool;
    return () => this.#drawOverlays();
  }

  get #takenTool() {
    return this.#tool?.isTaken ? this.#tool : null;
  }

  /** Draws the words on and about the picture, when it is made and when the page's language changes. */
  drawWords() {
    const help = this.#pointing ? say("view-help-pointing") : say("view-help");
    this.#element.setAttribute("aria-label", help);
    this.#picture.canvas.setAttribute("aria-label", say("live-view"));
    if (this.#last) this.#place();
  }

  /** @param {import("./framing.js").Point} point of the view, CSS pixels */
  #cellAt({ x, y }) {
    const { left, top, scale } = this.#framing.place;
    return { x: (x - left) / scale, y: (y - top) / scale };
  }

  get #isStale() {
    const { age } = this;
    return age === null || age > STALE_MS;
  }

  /** Shows no picture any more, and says nothing of one: the page's link is over. */
  end() {
    this.#ended = true;
    this.#element.hidden = true;
    setText(this.#heard, "");
    this.#colour.hidden = true;
  }

  /** @param {Stream.Frame} frame */
  #show({ header, bitmap, receivedAt }) {
    // The picture's size in pixels may change from one to the next; its place on the page does not.
    const { canvas } = this.#picture;
    const { width, height } = bitmap;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    this.#picture.drawImage(bitmap, 0, 0);
    this.#last = { header, receivedAt };
    this.#pointing?.see(header);

    this.#lookAtScreen();
    const cells = cellsOf(header);
    this.#framing.show(cells, this.#fit.see(cells, header.area, receivedAt));
    if (this.#shown.has("peaking")) this.#peaking.look(bitmap, cells, header.area);
    this.#place();

    this.#colour.hidden = !header.estimated;
    if (!this.#stale.hidden) this.#tellAge();
  }

  /** Puts the picture in its place, and updates everything that depends on that place. */
  #place() {
    if (!this.#last) return;
    const { left, top, scale } = this.#framing.place;
    const { width, height } = cellsOf(this.#last.header);
    Object.assign(this.#picture.canvas.style, {
      left: `${left}px`,
      top: `${top}px`,
      width: `${width * scale}px`,
      height: `${height * scale}px`,
    });

    const { zoom } = this.#framing;
    const isZoomed = zoom > 1.005;
    if (isZoomed) setText(this.#unzoom, say("show-all", { zoom: Math.round(zoom * 10) / 10 }));
    this.#unzoom.hidden = !isZoomed;
    this.#element.classList.toggle("viewer-is-zoomed", isZoomed);

    this.live.tellScreen(this.#framing.screenWidth);
    this.#drawOverlays();
  }

  #drawOverlays() {
    const context = this.#overlay;
    const { width, height } = context.canvas;
    const ring = this.#pointing?.ring ?? null;
    const corners = this.#shown.has("patch") || (this.#pointing?.isPointed ?? false);
    const marks = this.#tool?.hasMarks ? this.#tool : null;
    const drawn = this.#shown.size > 0 || corners || ring || marks ? this.#last : null;
    // Clearing an empty overlay for each picture would make the browser composite the whole view again each time.
    if (!drawn && this.#isOverlayClear) return;
    context.resetTransform();
    context.clearRect(0, 0, width, height);
    this.#isOverlayClear = !drawn;
    if (!drawn) return;

    const { header } = drawn;
    const density = pixelsPerCss(context.canvas);
    const { left, top, scale } = this.#framing.place;
    const pixels = scale * density;
    const line = 1.5 * density;
    context.translate(left * density, top * density);

    if (this.#shown.has("peaking")) {
      const cells = cellsOf(header);
      this.#peaking.draw(context, cells.width * pixels, cells.height * pixels);
    }
    if (this.#shown.has("content-area") && header.area) drawContentArea(context, header.area, pixels, line);
    for (const [name, draw] of this.#own) {
      if (this.#shown.has(name)) draw(context, header, pixels, line);
    }
    if (corners) drawPatch(context, header.patch, pixels, line);
    if (ring) drawRing(context, ring, header.patch, pixels, line);
    marks?.draw(context, pixels, line);
  }

  #tellAge() {
    if (this.#ended) return;
    const { age } = this;
    const isStale = this.#isStale;
    this.#element.classList.toggle("viewer-is-stale", isStale);

    // The text on screen counts the seconds. Screen readers announce only when the picture stops being live, and when
    // it is live again.
    if (this.#stale.hidden === isStale) {
      setText(this.#heard, isStale ? say("picture-not-live") : say("picture-live-again"));
    }
    this.#stale.hidden = !isStale;
    if (isStale) setText(this.#stale, staleText(age, this.#connected));
  }
}

/**
 * @param {number | null} age milliseconds; null before the first picture
 * @param {boolean} connected
 */
function staleText(age, connected) {
  const state = age === null ? say("picture-first") : ageText(age);
  return connected ? state : say("picture-connecting", { state });
}

/** @param {number} ms */
function ageText(ms) {
  const seconds = Math.round(ms / 1000);
  if (seconds < 2) return say("picture-old");
  if (seconds < 120) return say("picture-old-seconds", { seconds });
  return say("picture-old-minutes", { minutes: Math.round(seconds / 60) });
}
