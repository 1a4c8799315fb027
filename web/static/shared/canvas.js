// Canvases whose pixels are the screen's own, so that lines are crisp.

/** A canvas of class `className`. */
export function makeCanvas(className) {
  return Object.assign(document.createElement("canvas"), { className });
}

/** Screen pixels of `canvas` per CSS pixel. */
export function pixelsPerCss(canvas) {
  return canvas.width / (canvas.clientWidth || canvas.width);
}

/** Keeps the pixels of `canvas` the screen's own, and calls `draw` when they change. */
export function onResize(canvas, draw) {
  new ResizeObserver(() => {
    const dpr = window.devicePixelRatio || 1;
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * dpr));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * dpr));
    draw();
  }).observe(canvas);
}
