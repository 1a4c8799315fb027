// The live view: the picture, the overlays on it, and how old it is.

import { makeCanvas, onResize, pixelsPerCss } from "./canvas.js";
import { make, setText } from "./dom.js";
import { Live } from "./live.js";
import { drawContentArea, drawPatch, Peaking } from "./overlay.js";

/** @typedef {"patch" | "content-area" | "peaking"} Overlay */

/** A picture older than this is no longer live. */
const STALE_MS = 500;
const LOOK_MS = 250;

/** A live view within an element, which must be positioned and have a size of its own. */
export class Viewer {
  /** The stream, which brings the session and the devices' state too. */
  live;

  #element;
  #picture = makeCanvas("viewer-picture", { alpha: false });
  #overlay = makeCanvas("viewer-overlay");
  #stale = make("p", { className: "viewer-stale", "aria-hidden": "true" });
  #heard = make("p", { className: "viewer-heard visually-hidden", role: "status" });
  #colour = make(
    "p",
    { className: "viewer-colour", hidden: true },
    "Estimated colours: the camera measures no red light.",
  );
  /** @type {Set<string>} */
  #shown = new Set();
  #peaking = new Peaking();
  /** @type {{ header: Stream.Header, receivedAt: number } | null} */
  #last = null;
  #connected = false;

  /**
   * @param {HTMLElement} element
   * @param {"surgeon" | "operator" | "researcher"} role
   */
  constructor(element, role) {
    this.#element = element;
    this.#picture.canvas.setAttribute("role", "img");
    this.#picture.canvas.setAttribute("aria-label", "Live view");
    element.append(this.#picture.canvas, this.#overlay.canvas, this.#colour, this.#stale, this.#heard);
    onResize(this.#overlay.canvas, () => this.#drawOverlays());

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

  /** The server's run that counted the frame on screen. */
  get run() {
    return this.#last?.header.run ?? null;
  }

  /** Milliseconds since the picture on screen was exposed; null before the first. */
  get age() {
    return this.#last && this.#last.header.age + performance.now() - this.#last.receivedAt;
  }

  /**
   * Switches an overlay.
   *
   * @param {Overlay} name
   * @param {boolean} on
   */
  overlay(name, on) {
    if (on) this.#shown.add(name);
    else this.#shown.delete(name);
    this.#drawOverlays();
  }

  /** @param {Stream.Frame} frame */
  #show({ header, bitmap, receivedAt }) {
    const { canvas } = this.#picture;
    if (canvas.width !== header.width || canvas.height !== header.height) {
      Object.assign(canvas, { width: header.width, height: header.height });
    }
    this.#picture.drawImage(bitmap, 0, 0, header.width, header.height);
    this.#last = { header, receivedAt };

    if (this.#shown.has("peaking")) this.#peaking.look(bitmap, header.area);
    this.#drawOverlays();
    this.#colour.hidden = !header.estimated;
    if (!this.#stale.hidden) this.#tellAge();
  }

  #drawOverlays() {
    const context = this.#overlay;
    const { width, height } = context.canvas;
    context.resetTransform();
    context.clearRect(0, 0, width, height);
    if (!this.#last) return;

    // The picture keeps its shape within the element; the overlay lies on the picture.
    const { header } = this.#last;
    const scale = Math.min(width / header.width, height / header.height);
    context.translate((width - header.width * scale) / 2, (height - header.height * scale) / 2);

    const line = 1.5 * pixelsPerCss(context.canvas);
    if (this.#shown.has("peaking")) {
      this.#peaking.draw(context, header.width * scale, header.height * scale);
    }
    if (this.#shown.has("content-area") && header.area) drawContentArea(context, header.area, scale, line);
    if (this.#shown.has("patch")) drawPatch(context, header.patch, scale, line);
  }

  #tellAge() {
    const { age } = this;
    const isStale = age === null || age > STALE_MS;
    this.#element.classList.toggle("viewer-is-stale", isStale);

    // The seconds count on. A screen reader is told only when the picture stops being live, and when it is again.
    if (this.#stale.hidden === isStale) {
      setText(this.#heard, isStale ? "The picture is not live" : "The picture is live again");
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
  const told =
    age === null ? "Waiting for the first picture" : `Not live: the picture is ${ageText(age)} old`;
  return connected ? told : `${told} · connecting`;
}

/** @param {number} ms */
function ageText(ms) {
  const seconds = Math.round(ms / 1000);
  if (seconds < 2) return "more than half a second";
  return seconds < 120 ? `${seconds} seconds` : `${Math.round(seconds / 60)} minutes`;
}
