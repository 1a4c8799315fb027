// The panel beside a picture: the plot of its places' spectra, the places, and what can be done with them.

import { copyText } from "../shared/copy.js";
import { byId, make, redraw, setText } from "../shared/dom.js";
import { saveAs } from "../shared/save.js";
import { shape } from "../shared/svg.js";
import { tell, tellTrouble } from "../shared/trouble.js";
import { LOOKS } from "./looks.js";
import { Places } from "./places.js";
import { drawPlot, mark, PAPERS } from "./plot.js";
import { pngBlob, svgBlob } from "./saving.js";
import { csv, levelOf, unitOf } from "./table.js";
import { measuredWords, numberOf, unitWords, valueText, whereWords } from "./words.js";

/** @typedef {import("./places.js").Place} Place */
/** @typedef {import("./table.js").Measured} Measured */

/** Height and least width of the plot on the page, in pixels, with text of the usual size. */
const HEIGHT = 300;
const NARROWEST = 280;

/** The size of a page's text unless its reader has chosen another, in pixels. */
const USUAL_TEXT = 16;

/** The size of a saved plot, in pixels. */
const SAVED = { width: 720, height: 460 };

export class Panel {
  places = new Places();

  #changed;
  /** @type {{ frame: number, measured: Measured[] } | null} */
  #shown = null;
  /** Whether the page says why there are no spectra. */
  #isTroubled = false;
  #plot = byId("spectra-plot");
  #buttons = ["copy", "png", "svg", "clear"].map((name) => byId(`spectra-${name}`, HTMLButtonElement));

  /** @param {() => void} changed called when a person has changed the places or their radius */
  constructor(changed) {
    this.#changed = changed;
    this.#listen();
    byId("spectra-numbers", HTMLDetailsElement).ontoggle = () => this.#tabulate(this.#measured);
    new ResizeObserver(() => this.#drawPlot()).observe(this.#plot);
    this.#draw();
  }

  /**
   * Adds a place, if there is room for one more.
   *
   * @param {import("./places.js").Point} point
   */
  add(point) {
    const place = this.places.add(point);
    this.tell(place ? "" : `${LOOKS.length} places are the most. Remove one, then set another.`);
    if (place) this.#change();
    return place;
  }

  /** @param {Place} place */
  remove(place) {
    this.places.remove(place);
    this.tell("");
    this.#change();
  }

  clear() {
    this.places.clear();
    this.#shown = null;
    this.tell("");
    this.#change();
  }

  /**
   * Shows the spectra of a frame. Places that were removed meanwhile are left out.
   *
   * @param {number} frame
   * @param {Measured[]} measured
   */
  show(frame, measured) {
    this.#shown = { frame, measured };
    // What a person was told otherwise stays until they do something else.
    if (this.#isTroubled) this.tell("");
    this.#draw();
  }

  /** @param {string} text */
  tell(text) {
    this.#isTroubled = false;
    tell(byId("spectra-trouble"), text);
  }

  /** @param {unknown} error */
  tellTrouble(error) {
    this.#isTroubled = true;
    tellTrouble(byId("spectra-trouble"), error);
  }

  get #measured() {
    const measured = this.#shown?.measured ?? [];
    return measured.filter(({ place }) => this.places.all.includes(place));
  }

  #change() {
    this.#draw();
    this.#changed();
  }

  #listen() {
    const radius = byId("spectra-radius", HTMLInputElement);
    radius.value = String(this.places.radius);
    radius.oninput = () => {
      this.places.radius = radius.valueAsNumber;
      this.#change();
    };

    const [copy, png, svg, clear] = this.#buttons;
    if (!copy || !png || !svg || !clear) return;
    copyText(copy, () => csv(this.#measured, this.#shown?.frame ?? 0));
    png.onclick = async () => {
      try {
        saveAs(await pngBlob(this.#saved()), `${this.#name()}.png`);
      } catch {
        this.tell("This browser could not make the picture. Save it as SVG instead.");
      }
    };
    svg.onclick = () => saveAs(svgBlob(this.#saved()), `${this.#name()}.svg`);
    clear.onclick = () => this.clear();
  }

  #name() {
    return `spectra-frame-${this.#shown?.frame ?? 0}`;
  }

  #saved() {
    const measured = this.#measured;
    const unit = unitOf(measured);
    const caption = `Frame ${this.#shown?.frame ?? 0}, radius ${measured[0]?.radius ?? 0} samples. ${unitWords(unit)}`;
    return drawPlot(measured, unit, { ...SAVED, paper: PAPERS.paper, caption });
  }

  #draw() {
    const measured = this.#measured;
    const unit = unitOf(measured);
    setText(byId("spectra-radius-value"), `${this.places.radius} samples`);
    setText(byId("spectra-unit"), measured.length > 0 ? unitWords(unit) : "");
    setText(byId("spectra-frame"), measured.length > 0 ? `frame ${this.#shown?.frame}` : "");
    this.#plot.hidden = measured.length === 0;
    this.#drawPlot();
    this.#list(measured);
    this.#tabulate(measured);

    for (const button of this.#buttons) button.disabled = measured.length === 0;
    const clear = byId("spectra-clear", HTMLButtonElement);
    clear.disabled = this.places.all.length === 0;
    byId("spectra-numbers").hidden = measured.length === 0;
  }

  #drawPlot() {
    const measured = this.#measured;
    const enlarged = Number.parseFloat(getComputedStyle(document.documentElement).fontSize) / USUAL_TEXT;
    const width = Math.max(this.#plot.clientWidth, NARROWEST);
    const height = HEIGHT * Math.sqrt(enlarged);
    this.#plot.replaceChildren(
      drawPlot(measured, unitOf(measured), { width, height, enlarged, paper: PAPERS.page }),
    );
  }

  /** @param {Measured[]} measured */
  #list(measured) {
    const list = byId("spectra-places");
    for (const line of [...list.children]) {
      const kept = this.places.all.some((place) => this.#lineOf(place) === line);
      if (!kept) line.remove();
    }
    for (const place of this.places.all) {
      const line = this.#lineOf(place) ?? this.#newLine(place, list);
      const found = measured.find((one) => one.place === place);
      const words = line.querySelector(".measured");
      if (words instanceof HTMLElement) setText(words, found ? measuredWords(found) : "…");
    }
  }

  /** @type {WeakMap<Place, HTMLElement>} */
  #lines = new WeakMap();

  /** @param {Place} place */
  #lineOf(place) {
    return this.#lines.get(place);
  }

  /**
   * @param {Place} place
   * @param {HTMLElement} list
   */
  #newLine(place, list) {
    const number = numberOf(place);
    const swatch = shape("svg", { viewBox: "0 0 20 20", width: 20, height: 20, "aria-hidden": "true" });
    swatch.append(mark(place.look, 10, 10, PAPERS.page, 6));
    const remove = make("button", { type: "button", "aria-label": `Remove place ${number}` }, "Remove");
    remove.onclick = () => this.#removeByButton(place, list);
    const words = make("span", { className: "where number" }, `${number}: ${whereWords(place)}`);
    const line = make("li", {}, swatch, words, make("span", { className: "measured muted" }), remove);

    const after = this.places.all.find((other) => other.look > place.look && this.#lineOf(other));
    list.insertBefore(line, (after && this.#lineOf(after)) ?? null);
    this.#lines.set(place, line);
    return line;
  }

  /**
   * The keyboard's focus goes on to the next button, so that it is not lost with the line.
   *
   * @param {Place} place
   * @param {HTMLElement} list
   */
  #removeByButton(place, list) {
    const line = this.#lineOf(place);
    const next = line?.nextElementSibling ?? line?.previousElementSibling;
    this.remove(place);
    const button =
      next?.querySelector("button") ?? (list.childElementCount === 0 ? byId("spectra-radius") : null);
    button?.focus({ preventScroll: true });
  }

  /** @param {Measured[]} measured */
  #tabulate(measured) {
    if (!byId("spectra-numbers", HTMLDetailsElement).open) return;
    const unit = unitOf(measured);
    const head = measured.map(({ place }) => make("th", { scope: "col" }, `Place ${numberOf(place)}`));
    const bands = measured[0]?.spectrum.bands ?? [];
    const rows = bands.map(({ wavelength_nm: nm }, index) => {
      const cells = measured.map(({ spectrum }) => {
        const band = spectrum.bands[index];
        const { mean, spread } = band ? levelOf(band, unit) : { mean: 0, spread: 0 };
        return make("td", {}, `${valueText(mean, unit)} ± ${valueText(spread, unit)}`);
      });
      return make("tr", {}, make("th", { scope: "row" }, `${nm.toFixed(1)} nm`), ...cells);
    });
    redraw(byId("spectra-table"), [
      make("thead", {}, make("tr", {}, make("th", { scope: "col" }, "Wavelength"), ...head)),
      make("tbody", {}, ...rows),
    ]);
  }
}
