// @ts-check
/** Small images of frames. */

import { decodeImage } from "./image-cache.js";

/** @typedef {import("./sources.js").Source} Source */

/**
 * A frame as a JPEG image, shrunk so that no side is longer than `longest`.
 * @param {Source} source
 * @param {number} longest in pixels
 * @param {number} quality 0 to 1
 */
export async function thumbnail(source, longest, quality) {
  const image = await decodeImage(source);
  const scale = Math.min(1, longest / Math.max(image.width, image.height));
  const [width, height] = [image.width, image.height].map((side) => Math.round(scale * side));
  const canvas = new OffscreenCanvas(Math.max(1, width), Math.max(1, height));
  const context = canvas.getContext("2d");
  if (context) {
    context.imageSmoothingQuality = "high";
    context.drawImage(image, 0, 0, canvas.width, canvas.height);
  }
  image.close();
  return canvas.convertToBlob({ type: "image/jpeg", quality });
}
