// @ts-check
/** Images for the extraction, in workers. */

import init, { imageToArray, needsDecoding } from "./pkg/index.js";

/**
 * The image as the extraction reads it: JPEG and WebP are decoded by a part of the package that is fetched for the first
 * of them.
 * @param {Uint8Array} image
 * @param {string} path
 */
export async function decodable(image, path) {
  if (!needsDecoding(image)) return image;
  await init(["images"]);
  return imageToArray(image, path);
}
