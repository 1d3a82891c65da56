// @ts-check
/** Decoded images of the frames last shown. */

/** @typedef {import("./files.js").Source} Source */

/** As many as fit in here stay decoded, at four bytes a pixel. */
const BUDGET_BYTES = 96 * 1024 * 1024;

export class ImageCache {
  /** In the order of last use. @type {Map<Blob, ImageBitmap | null>} */
  #images = new Map();
  /** @type {Map<Blob, Promise<ImageBitmap | null>>} */
  #loading = new Map();
  #bytes = 0;

  /**
   * The image if it is decoded: `null` when it cannot be decoded, `undefined` when that is not known yet.
   * @param {Source} source
   */
  peek({ blob }) {
    const image = this.#images.get(blob);
    if (image !== undefined) {
      this.#images.delete(blob);
      this.#images.set(blob, image);
    }
    return image;
  }

  /**
   * Decodes an image as it is stored, whatever orientation its metadata ask for, as the extraction does.
   * @param {Source} source
   * @returns {Promise<ImageBitmap | null>}
   */
  load({ blob }) {
    const known = this.peek({ path: "", blob });
    if (known !== undefined) return Promise.resolve(known);
    let loading = this.#loading.get(blob);
    if (!loading) {
      loading = createImageBitmap(blob, { imageOrientation: "none" })
        .catch(() => null)
        .then((image) => {
          if (this.#loading.delete(blob)) this.#keep(blob, image);
          return image;
        });
      this.#loading.set(blob, loading);
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
   * @param {Blob} blob
   * @param {ImageBitmap | null} image
   */
  #keep(blob, image) {
    this.#images.set(blob, image);
    this.#bytes += sizeOf(image);
    for (const [oldest, old] of this.#images) {
      if (this.#bytes <= BUDGET_BYTES || oldest === blob) break;
      this.#images.delete(oldest);
      this.#bytes -= sizeOf(old);
      old?.close();
    }
  }
}

/** @param {ImageBitmap | null} image */
function sizeOf(image) {
  return image ? image.width * image.height * 4 : 0;
}
