// The plot as a file: SVG, or PNG at twice its size for sharp print.

const DENSITY = 2;

/** @param {Element} svg */
export function svgBlob(svg) {
  const text = new XMLSerializer().serializeToString(svg);
  return new Blob([`<?xml version="1.0" encoding="UTF-8"?>\n${text}\n`], { type: "image/svg+xml" });
}

/**
 * @param {Element} svg with a width and a height
 * @returns {Promise<Blob>}
 */
export async function pngBlob(svg) {
  const address = URL.createObjectURL(svgBlob(svg));
  try {
    const image = new Image();
    image.src = address;
    await image.decode();
    const canvas = document.createElement("canvas");
    canvas.width = DENSITY * image.width;
    canvas.height = DENSITY * image.height;
    canvas.getContext("2d")?.drawImage(image, 0, 0, canvas.width, canvas.height);
    return await new Promise((done, failed) => {
      canvas.toBlob(
        (blob) => (blob ? done(blob) : failed(new Error("this browser makes no PNG"))),
        "image/png",
      );
    });
  } finally {
    URL.revokeObjectURL(address);
  }
}
