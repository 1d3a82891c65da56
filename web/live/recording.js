// @ts-check
/** A few seconds of frames, kept as images with their keypoints. */

/**
 * @typedef {import("../extraction/extractor.js").Extracted} Extracted
 * @typedef {{ path: string, blob: Blob, extracted: Extracted }} Recorded
 */

/** A recording ends by itself at this many frames, or seconds. */
export const MOST = { frames: 600, seconds: 60 };

export class Recording {
  folder;
  /** @type {{ image: Promise<Blob>, extracted: Extracted }[]} */
  #frames = [];
  #start = performance.now();
  #last = this.#start;

  /** @param {string} folder that is called like the sequence */
  constructor(folder) {
    this.folder = folder;
  }

  get length() {
    return this.#frames.length;
  }

  /** From the first to the last frame. */
  get seconds() {
    return (this.#last - this.#start) / 1000;
  }

  get isFull() {
    return this.length >= MOST.frames || this.seconds >= MOST.seconds;
  }

  /**
   * @param {ImageData} image
   * @param {Extracted} extracted
   */
  add(image, extracted) {
    this.#last = performance.now();
    if (this.length === 0) this.#start = this.#last;
    this.#frames.push({ image: pngOf(image), extracted });
  }

  /** The frames as files. @returns {Promise<Recorded[]>} */
  files() {
    const file = async (
      /** @type {{ image: Promise<Blob>, extracted: Extracted }} */ { image, extracted },
      /** @type {number} */ i,
    ) => {
      const path = `${this.folder}/frame_${String(i).padStart(4, "0")}.png`;
      return { path, blob: await image, extracted };
    };
    return Promise.all(this.#frames.map(file));
  }
}

/**
 * An image without loss.
 * @param {ImageData} image
 */
function pngOf(image) {
  const canvas = new OffscreenCanvas(image.width, image.height);
  canvas.getContext("2d", { alpha: false })?.putImageData(image, 0, 0);
  return canvas.convertToBlob({ type: "image/png" });
}
