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
 * Keeps `canvas` at the screen's own resolution, and calls `draw` when that changes. Call the returned function now
 * and then: no event reports reliably that the window has moved to a screen with another number of pixels per CSS
 * pixel, because nothing on the page need change its size.
 *
 * @param {HTMLCanvasElement} canvas
 * @param {() => void} draw
 */
export function onResize(canvas, draw) {
  let density = 0;
  const fit = () => {
    density = window.devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * density));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * density));
    draw();
  };

  new ResizeObserver(fit).observe(canvas);
  return () => {
    if (density !== (window.devicePixelRatio || 1)) fit();
  };
}
