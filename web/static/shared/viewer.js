// The live view: the picture, the overlays on it, and how old it is.

import { makeCanvas, onResize, pixelsPerCss } from "./canvas.js";
import { Live } from "./live.js";
import { drawContentArea, drawPatch, Peaking } from "./overlay.js";
import { Traces } from "../operator/traces.js";

/** A picture older than this is no longer live, and says so. */
const STALE_MS = 500;

/**
 * Puts a live view into `element`, which must be positioned and have a size of its own.
 *
 * @param {HTMLElement} element
 * @param {{role: "surgeon"|"operator"|"researcher", traces?: HTMLElement}} options `traces`: where the traces of focal
 *   power and metric go; they come to operator and researcher alone
 * @returns {Viewer}
 */
export function mountViewer(element, options) {
  return new Viewer(element, options);
}

/** Emits "frame" (a CustomEvent whose detail is the header of the frame now on screen). */
class Viewer extends EventTarget {
  /** Number of the frame on screen; null before the first. */
  frame = null;
  /** The server's run that counted it. */
  run = null;
  /** The stream: emits "session", "status" and "connection". */
  live;

  #element;
  #picture = makeCanvas("viewer-picture").getContext("2d", { alpha: false });
  #overlay = makeCanvas("viewer-overlay").getContext("2d");
  #stale = Object.assign(document.createElement("p"), { className: "viewer-stale" });
  #heard = Object.assign(document.createElement("p"), { className: "viewer-heard visually-hidden" });
  #colour = Object.assign(document.createElement("p"), { className: "viewer-colour", hidden: true });
  #shown = new Set();
  #peaking = new Peaking();
  #traces;
  #last = null;
  #connected = false;

  constructor(element, { role, traces }) {
    super();
    this.#element = element;
    this.#picture.canvas.setAttribute("role", "img");
    this.#picture.canvas.setAttribute("aria-label", "Live view");
    // Its seconds count on; only that it is not live, and that it is again, are worth a screen reader's word.
    this.#stale.setAttribute("aria-hidden", "true");
    this.#heard.setAttribute("role", "status");
    this.#colour.textContent = "Colours estimated from 460–600 nm; reds are inferred.";
    element.append(this.#picture.canvas, this.#overlay.canvas, this.#colour, this.#stale, this.#heard);
    this.#traces = traces && new Traces(traces);
    onResize(this.#overlay.canvas, () => this.#drawOverlays());
    this.live = new Live(role);
    this.live.addEventListener("frame", ({ detail }) => this.#show(detail));
    this.live.addEventListener("connection", ({ detail }) => {
      this.#connected = detail.open;
      this.#tellAge();
    });
    setInterval(() => this.#tellAge(), 250);
    this.#tellAge();
  }

  /** Milliseconds since the picture on screen was exposed; null before the first. */
  get age() {
    return this.#last && this.#last.header.age + performance.now() - this.#last.receivedAt;
  }

  /**
   * Switches an overlay.
   *
   * @param {"patch"|"content-area"|"peaking"|"traces"|"belief"} name
   * @param {boolean} on
   */
  overlay(name, on) {
    if (on) this.#shown.add(name);
    else this.#shown.delete(name);
    this.#traces?.show(this.#shown.has("traces"), this.#shown.has("belief"));
    this.#drawOverlays();
  }

  #show({ header, bitmap, receivedAt }) {
    const { canvas } = this.#picture;
    if (canvas.width !== header.width || canvas.height !== header.height) {
      Object.assign(canvas, { width: header.width, height: header.height });
    }
    this.#picture.drawImage(bitmap, 0, 0, header.width, header.height);
    this.#last = { header, receivedAt };
    this.frame = header.frame;
    this.run = header.run;
    if (this.#shown.has("peaking")) this.#peaking.look(bitmap, header.area);
    this.#drawOverlays();
    this.#traces?.add(header, receivedAt - header.age);
    this.#colour.hidden = !header.estimated;
    if (!this.#stale.hidden) this.#tellAge();
    this.dispatchEvent(new CustomEvent("frame", { detail: header }));
  }

  #drawOverlays() {
    const context = this.#overlay;
    const { width, height } = context.canvas;
    context.resetTransform();
    context.clearRect(0, 0, width, height);
    if (!this.#last) return;
    const { header } = this.#last;
    // The picture keeps its shape within the element; the overlay lies on the picture.
    const scale = Math.min(width / header.width, height / header.height);
    context.translate((width - header.width * scale) / 2, (height - header.height * scale) / 2);
    const line = 1.5 * pixelsPerCss(context.canvas);
    if (this.#shown.has("peaking")) this.#peaking.draw(context, header.width * scale, header.height * scale);
    if (this.#shown.has("content-area") && header.area) drawContentArea(context, header.area, scale, line);
    if (this.#shown.has("patch")) drawPatch(context, header.patch, scale, line);
  }

  #tellAge() {
    const { age } = this;
    const isStale = age === null || age > STALE_MS;
    this.#element.classList.toggle("viewer-is-stale", isStale);
    if (this.#stale.hidden === isStale) this.#heard.textContent = isStale ? "The picture is not live" : "The picture is live again";
    this.#stale.hidden = !isStale;
    if (!isStale) return;
    const told = age === null ? "Waiting for the first picture" : `Not live: the picture is ${inWords(age)} old`;
    const text = this.#connected ? told : `${told} · connecting`;
    if (this.#stale.textContent !== text) this.#stale.textContent = text;
  }
}

function inWords(ms) {
  const seconds = Math.round(ms / 1000);
  if (seconds < 2) return "more than half a second";
  return seconds < 120 ? `${seconds} seconds` : `${Math.round(seconds / 60)} minutes`;
}
