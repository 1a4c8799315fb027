// How the places are told apart: by colour, and by a mark for those who see colours differently. The colours are
// Okabe and Ito's (Color Universal Design, 2008), each with a darker one for white paper.

/**
 * @typedef {object} Look
 * @property {string} dark the colour on the dark page and on the picture
 * @property {string} light the colour on white
 * @property {"circle" | "square" | "triangle" | "diamond" | "cross"} mark
 */

/** The look of each place, by its index. @type {Look[]} */
export const LOOKS = [
  { dark: "#56b4e9", light: "#1f7fc4", mark: "circle" },
  { dark: "#f0e442", light: "#b09400", mark: "square" },
  { dark: "#009e73", light: "#005c44", mark: "triangle" },
  { dark: "#d55e00", light: "#b53a00", mark: "diamond" },
  { dark: "#ffffff", light: "#000000", mark: "cross" },
];

/**
 * The mark of a place around a point, as the `d` of an SVG path.
 *
 * @param {Look["mark"]} mark
 * @param {number} x
 * @param {number} y
 * @param {number} size half of the mark's width
 */
export function markPath(mark, x, y, size) {
  const at = (/** @type {number} */ across, /** @type {number} */ down) =>
    `${(x + across * size).toFixed(1)} ${(y + down * size).toFixed(1)}`;

  switch (mark) {
    case "circle":
      return `M${at(-1, 0)} a${size} ${size} 0 1 0 ${2 * size} 0 a${size} ${size} 0 1 0 ${-2 * size} 0 z`;
    case "square":
      return `M${at(-0.9, -0.9)} L${at(0.9, -0.9)} L${at(0.9, 0.9)} L${at(-0.9, 0.9)} z`;
    case "triangle":
      return `M${at(0, -1.1)} L${at(1.1, 0.9)} L${at(-1.1, 0.9)} z`;
    case "diamond":
      return `M${at(0, -1.3)} L${at(1.1, 0)} L${at(0, 1.3)} L${at(-1.1, 0)} z`;
    case "cross":
      return `M${at(-0.9, -0.9)} L${at(0.9, 0.9)} M${at(0.9, -0.9)} L${at(-0.9, 0.9)}`;
  }
}
