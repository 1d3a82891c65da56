// @ts-check
/** Images for the extraction, in workers. */

import init, { decodingMemory, imageToArray, needsDecoding } from "../pkg/index.js";

/** The part of the package cannot be loaded: no fault of an image. */
export class PartError extends Error {}

let isLoaded = false;

/**
 * The image as the extraction reads it: JPEG and WebP are decoded by a part of the package that is
 * fetched for the first of them.
 * @param {Uint8Array} image
 * @param {string} path
 */
export async function decodable(image, path) {
  if (!needsDecoding(image)) return image;
  await init(["images"]).catch((error) => {
    throw new PartError(
      `JPEG and WebP images need a part of the page that is not there: ${error.message}`,
    );
  });
  isLoaded = true;
  return imageToArray(image, path);
}

/** Bytes that decoding takes here; they are never given back. */
export function memoryOfDecoding() {
  return isLoaded ? decodingMemory() : 0;
}
