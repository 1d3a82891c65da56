// @ts-check
/** Figures as pixels. */

import { h } from "./dom.js";

/** Pixels of a PNG for one of the figure. */
const SCALE = 2;

/**
 * A figure as PNG.
 * @param {string} svg
 * @returns {Promise<Blob>}
 */
export async function toPng(svg) {
  const url = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
  try {
    const image = new Image();
    image.src = url;
    await image.decode();
    const [width, height] = [SCALE * image.naturalWidth, SCALE * image.naturalHeight];
    const canvas = h("canvas", { width, height });
    canvas.getContext("2d")?.drawImage(image, 0, 0, width, height);
    return await new Promise((resolve, reject) =>
      canvas.toBlob((blob) => {
        if (blob) resolve(blob);
        else reject(new Error("the browser cannot make a PNG of the figure"));
      }, "image/png"),
    );
  } finally {
    URL.revokeObjectURL(url);
  }
}
