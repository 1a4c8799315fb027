// What is drawn on the picture. `scale` is screen pixels per picture pixel, `line` a line's width in screen pixels.

const PATCH_COLOUR = "#5cf2ff";
const AREA_COLOUR = "#ffffff";
const PEAKING_RGBA = [57, 255, 110, 255];

/** Wider pictures are looked at in less detail, to stay cheap. */
const PEAKING_WIDTH = 640;

/** Pixels at the edge of the content area that are not looked at: the edge itself is sharp. */
const PEAKING_MARGIN = 8;

/** What noise alone makes of the measure. */
const PEAKING_NOISE = 40;

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

/** Focus peaking: marks the finest detail, which only what is in focus has. */
export class Peaking {
  #reader = scratch({ willReadFrequently: true, alpha: false });
  #marks = scratch();

  /** Looks at a new picture; `area`, if there is one, is the circle outside which there is nothing to see. */
  look(bitmap, area) {
    const scale = Math.min(1, PEAKING_WIDTH / bitmap.width);
    const [width, height] = [Math.round(bitmap.width * scale), Math.round(bitmap.height * scale)];
    for (const { canvas } of [this.#reader, this.#marks]) {
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    }
    this.#reader.drawImage(bitmap, 0, 0, width, height);
    const { data } = this.#reader.getImageData(0, 0, width, height);
    const marks = this.#marks.createImageData(width, height);
    const circle = area && { x: area.x * scale, y: area.y * scale, radius: area.radius * scale - PEAKING_MARGIN };
    markDetail(data, marks.data, width, height, circle);
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
 * Marks the pixels within `circle` that differ most from the mean of their four neighbours (the Laplacian: a blurred edge,
 * however strong, hardly has one): by four times the mean, and by more than noise alone. Taken from green, which carries
 * most of the detail.
 */
function markDetail(rgba, marks, width, height, circle) {
  const details = new Uint16Array(width * height);
  let sum = 0;
  let count = 1;
  for (let y = 1; y < height - 1; y++) {
    const half = circle ? Math.sqrt(Math.max(0, circle.radius ** 2 - (y - circle.y) ** 2)) : width;
    const first = Math.max(1, Math.ceil((circle?.x ?? 0) - half));
    const end = Math.min(width - 1, Math.floor((circle?.x ?? 0) + half));
    for (let x = first; x < end; x++) {
      const green = (y * width + x) * 4 + 1;
      const neighbours = rgba[green - 4] + rgba[green + 4] + rgba[green - 4 * width] + rgba[green + 4 * width];
      sum += details[y * width + x] = Math.abs(4 * rgba[green] - neighbours);
      count++;
    }
  }
  const threshold = Math.max(PEAKING_NOISE, (4 * sum) / count);
  for (let at = 0; at < details.length; at++) {
    if (details[at] > threshold) marks.set(PEAKING_RGBA, at * 4);
  }
}
