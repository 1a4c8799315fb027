// Dims the page around the picture, for a dark room. The picture itself stays as bright as it is, because it is what is
// judged. This device keeps the choice.

const NAME = "parfocal.brightness";
const LEAST = 30;
const MOST = 100;

/**
 * A kept brightness, in percent; full if nothing valid is kept.
 *
 * @param {string | null} kept
 */
export function brightnessOf(kept) {
  const percent = Number(kept ?? MOST);
  return percent >= LEAST && percent <= MOST ? percent : MOST;
}

/**
 * @param {HTMLInputElement} slider
 * @param {import("../shared/storage.js").Store} store
 */
export function followDimmer(slider, store) {
  const show = (/** @type {number} */ percent) => {
    document.body.classList.toggle("dimmed", percent < MOST);
    document.body.style.setProperty("--brightness", String(percent / 100));
  };

  const kept = brightnessOf(store.read(NAME));
  slider.value = String(kept);
  show(kept);
  slider.addEventListener("input", () => {
    show(slider.valueAsNumber);
    store.write(NAME, slider.value);
  });
}
