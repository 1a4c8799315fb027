// What is drawn on the picture. `scale` is screen pixels per picture pixel, `line` a line's width in screen pixels.

const PATCH_COLOUR = "#5cf2ff";
const AREA_COLOUR = "#ffffff";
const PEAKING_RGBA = [57, 255, 110, 255];

/** Wider pictures are looked at in less detail, to stay cheap. */
const PEAKING_WIDTH = 640;

/** A line that is seen on dark and on bright. */
function stroke(context, colour, width, path) {
  for (const [style, lineWidth] of [["rgba(0, 0, 0, .55)", width * 2.2], [colour, width]]) {
    context.strokeStyle = style;
    context.lineWidth = lineWidth;
    context.beginPath();
    path();
    context.stroke();
  }
}

/** The patch that the focus is judged by: its four corners. */
export function drawPatch(context, patch, scale, line) {
  const [left, top] = [patch.x * scale, patch.y * scale];
  const [right, bottom] = [left + patch.width * scale, top + patch.height * scale];
  const arm = (right - left) / 4;
  const corners = [[left, top, 1, 1], [right, top, -1, 1], [right, bottom, -1, -1], [left, bottom, 1, -1]];
  stroke(context, PATCH_COLOUR, line, () => {
    for (const [x, y, dx, dy] of corners) {
      context.moveTo(x + dx * arm, y);
      context.lineTo(x, y);
      context.lineTo(x, y + dy * arm);
    }
  });
}

/** The circle that holds the picture. */
export function drawContentArea(context, area, scale, line) {
  context.setLineDash([4 * line, 4 * line]);
  stroke(context, AREA_COLOUR, line, () => {
    context.arc(area.x * scale, area.y * scale, area.radius * scale, 0, 2 * Math.PI);
  });
  context.setLineDash([]);
}

/** Focus peaking: marks where the picture changes most sharply from pixel to pixel. */
export class Peaking {
  #reader = scratch({ willReadFrequently: true, alpha: false });
  #marks = scratch();

  /** Looks at a new picture. */
  look(bitmap) {
    const scale = Math.min(1, PEAKING_WIDTH / bitmap.width);
    const [width, height] = [Math.round(bitmap.width * scale), Math.round(bitmap.height * scale)];
    for (const { canvas } of [this.#reader, this.#marks]) {
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    }
    this.#reader.drawImage(bitmap, 0, 0, width, height);
    const marks = this.#marks.createImageData(width, height);
    markSharp(this.#reader.getImageData(0, 0, width, height).data, marks.data, width, height);
    this.#marks.putImageData(marks, 0, 0);
  }

  draw(context, width, height) {
    context.imageSmoothingEnabled = false;
    context.drawImage(this.#marks.canvas, 0, 0, width, height);
  }
}

function scratch(options) {
  return document.createElement("canvas").getContext("2d", options);
}

/**
 * Marks the pixels with the steepest gradient: above four times the picture's mean, and above what noise alone makes.
 * Taken from green by central differences: green carries most of the detail.
 */
function markSharp(rgba, marks, width, height) {
  const NOISE = 24;
  const gradients = new Uint16Array(width * height);
  let sum = 0;
  for (let y = 1; y < height - 1; y++) {
    for (let x = 1; x < width - 1; x++) {
      const green = (y * width + x) * 4 + 1;
      const across = Math.abs(rgba[green + 4] - rgba[green - 4]);
      const down = Math.abs(rgba[green + 4 * width] - rgba[green - 4 * width]);
      sum += gradients[y * width + x] = across + down;
    }
  }
  const threshold = Math.max(NOISE, (4 * sum) / gradients.length);
  for (let at = 0; at < gradients.length; at++) {
    if (gradients[at] > threshold) marks.set(PEAKING_RGBA, at * 4);
  }
}
