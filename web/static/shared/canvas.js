// Canvases whose pixels are the screen's own, so that lines are crisp.

/**
 * A canvas of class `className`, ready to draw on.
 *
 * @param {string} className
 * @param {CanvasRenderingContext2DSettings} [settings]
 */
export function makeCanvas(className, settings) {
  const canvas = Object.assign(document.createElement("canvas"), { className });
  return contextOf(canvas, settings);
}

/**
 * @param {HTMLCanvasElement} canvas
 * @param {CanvasRenderingContext2DSettings} [settings]
 */
export function contextOf(canvas, settings) {
  const context = canvas.getContext("2d", settings);
  if (!context) throw new Error("this browser cannot draw on a canvas");
  return context;
}

/**
 * Screen pixels of `canvas` per CSS pixel.
 *
 * @param {HTMLCanvasElement} canvas
 */
export function pixelsPerCss(canvas) {
  return canvas.width / (canvas.clientWidth || canvas.width);
}

/**
 * Keeps the pixels of `canvas` the screen's own, and calls `draw` when they change.
 *
 * @param {HTMLCanvasElement} canvas
 * @param {() => void} draw
 */
export function onResize(canvas, draw) {
  new ResizeObserver(() => {
    const dpr = window.devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * dpr));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * dpr));
    draw();
  }).observe(canvas);
}
