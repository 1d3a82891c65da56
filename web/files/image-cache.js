// @ts-check
/** Decoded images of the frames last shown. */

import { NPY_TYPE, imageOfArray } from "./containers/npy.js";
import { blobOf } from "./sources.js";

/** @typedef {import("./sources.js").Source} Source */

/** As many as fit in here stay decoded, at four bytes a pixel. */
const BUDGET_BYTES = 96 * 1024 * 1024;

export class ImageCache {
  /** In the order of last use. @type {Map<Source, ImageBitmap | null>} */
  #images = new Map();
  /** @type {Map<Source, Promise<ImageBitmap | null>>} */
  #loading = new Map();
  #bytes = 0;

  /**
   * The image if it is decoded: `null` when it cannot be decoded, `undefined` when that is not
   * known yet.
   * @param {Source} source
   */
  peek(source) {
    const image = this.#images.get(source);
    if (image !== undefined) {
      this.#images.delete(source);
      this.#images.set(source, image);
    }
    return image;
  }

  /**
   * The image, decoded if it is not yet; `null` when it cannot be.
   * @param {Source} source
   * @returns {Promise<ImageBitmap | null>}
   */
  load(source) {
    const known = this.peek(source);
    if (known !== undefined) return Promise.resolve(known);
    let loading = this.#loading.get(source);
    if (!loading) {
      loading = decodeImage(source)
        .catch(() => null)
        .then((image) => {
          // Cleared in the meantime: nobody would ever close it.
          if (this.#loading.get(source) === loading) {
            this.#loading.delete(source);
            this.#keep(source, image);
          }
          return image;
        });
      this.#loading.set(source, loading);
    }
    return loading;
  }

  clear() {
    for (const image of this.#images.values()) image?.close();
    this.#images.clear();
    this.#loading.clear();
    this.#bytes = 0;
  }

  /**
   * @param {Source} source
   * @param {ImageBitmap | null} image
   */
  #keep(source, image) {
    this.#images.set(source, image);
    this.#bytes += sizeOf(image);
    for (const [oldest, old] of this.#images) {
      if (this.#bytes <= BUDGET_BYTES || oldest === source) break;
      this.#images.delete(oldest);
      this.#bytes -= sizeOf(old);
      old?.close();
    }
  }
}

/**
 * Decodes an image as it is stored, whatever orientation its metadata ask for, as the extraction
 * does.
 * @param {Source} source
 * @returns {Promise<ImageBitmap>}
 */
export async function decodeImage(source) {
  const blob = await blobOf(source);
  const image = blob.type === NPY_TYPE ? await imageOfArray(blob) : blob;
  return createImageBitmap(image, { imageOrientation: "none" });
}

/** @param {ImageBitmap | null} image */
function sizeOf(image) {
  return image ? image.width * image.height * 4 : 0;
}
