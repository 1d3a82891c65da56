// @ts-check
/**
 * Videos: the frames of a file by index, decoded by the browser (WebCodecs) when they are asked
 * for. Mediabunny, which tells the container's parts apart, is fetched with the first video.
 */

import { messageOf } from "../../errors.js";
import { blobOf, folderOf } from "../sources.js";
import { mediabunny } from "./mediabunny.js";
import { arrayOfPixels } from "./npy.js";

/**
 * @typedef {import("../sources.js").Source} Source
 *
 * @typedef {object} Video
 * @property {Source[]} frames
 * @property {number[]} times when each is shown, in seconds
 * @property {string} codec
 * @property {() => void} close gives back the frames that were decoded ahead
 */

const MOST_FRAMES = 200_000;
/** Frames that are kept as they were decoded, since neighbours are asked for together. */
const KEPT = 8;

/**
 * The frames of a video, as a sequence that is called like the file.
 * @param {Source} source
 * @returns {Promise<Video>}
 */
export async function openVideo(source) {
  const { path } = source;
  if (!("VideoDecoder" in globalThis)) {
    throw new Error(
      `${path} cannot be decoded: this browser has no WebCodecs here. Expected Chrome or Edge ` +
        "94, Firefox 130, Safari 16.4 or " +
        "later, and the page from https:// or localhost; or make images of the video: ffmpeg -i " +
        "VIDEO frames/%06d.png",
    );
  }
  const library = await mediabunny();
  if (!library)
    throw new Error(
      `${path} cannot be opened: the page's reader of videos could not be fetched; try again`,
    );
  const { ALL_FORMATS, BlobSource, EncodedPacketSink, Input, VideoSampleSink } = library;
  const input = new Input({ formats: ALL_FORMATS, source: new BlobSource(await blobOf(source)) });
  const track = await input.getPrimaryVideoTrack().catch((/** @type {unknown} */ error) => {
    throw new Error(
      `${path} is not a whole video (${messageOf(error)}); expected MP4, WebM, MKV or MOV. Is ` +
        "the file " +
        "complete?",
    );
  });
  if (!track) throw new Error(`${path} has no video track; expected one with frames`);
  if (!(await track.canDecode())) {
    const codec = (await track.getCodecParameterString()) ?? "an unknown codec";
    throw new Error(
      `${path} is packed by ${codec}, which this browser cannot decode. Convert it, e.g. ffmpeg ` +
        "-i VIDEO -c:v libvpx-vp9 " +
        "-crf 20 VIDEO.webm, or to images: ffmpeg -i VIDEO frames/%06d.png",
    );
  }
  const times = [];
  for await (const { timestamp } of new EncodedPacketSink(track).packets(undefined, undefined, {
    metadataOnly: true,
  })) {
    times.push(timestamp);
    if (times.length > MOST_FRAMES)
      throw new Error(`${path} has more than ${MOST_FRAMES} frames; cut it into several`);
  }
  // Packets come in the order of decoding.
  times.sort((a, b) => a - b);
  const reader = new Reader(new VideoSampleSink(track), times, path);
  const folder = folderOf(path);
  return {
    frames: times.map((_, i) => ({
      path: `${folder}/frame_${String(i).padStart(6, "0")}`,
      read: () => reader.frame(i),
    })),
    times,
    codec: track.codec,
    close: () => reader.close(),
  };
}

/**
 * Reads on from the frame before where that is the one asked for, and from the key frame before
 * otherwise.
 */
class Reader {
  #sink;
  #times;
  #path;
  /** @type {AsyncGenerator<any, void> | null} */
  #samples = null;
  /** The frame that `#samples` gives next. */
  #next = 0;
  /** @type {Map<number, Blob>} */
  #kept = new Map();
  /** One frame at a time. @type {Promise<unknown>} */
  #last = Promise.resolve();
  #canvas = new OffscreenCanvas(1, 1);

  /**
   * @param {any} sink
   * @param {number[]} times
   * @param {string} path
   */
  constructor(sink, times, path) {
    this.#sink = sink;
    this.#times = times;
    this.#path = path;
  }

  /**
   * @param {number} i
   * @returns {Promise<Blob>}
   */
  frame(i) {
    const read = this.#last.then(() => this.#kept.get(i) ?? this.#read(i));
    this.#last = read.catch(() => {});
    return read;
  }

  /** Gives back what was decoded ahead, after the frames asked for. */
  close() {
    this.#last = this.#last.then(() => this.#stop()).catch(() => {});
  }

  async #stop() {
    const samples = this.#samples;
    this.#samples = null;
    this.#kept.clear();
    await samples?.return(undefined);
  }

  /** @param {number} i */
  async #read(i) {
    try {
      // A few frames further it is cheaper to decode those between.
      if (!this.#samples || i < this.#next || i > this.#next + KEPT) {
        await this.#samples?.return(undefined);
        this.#samples = this.#sink.samples(this.#times[i]);
        this.#next = i;
      }
      let frame;
      while (this.#next <= i) {
        const { value, done } = await /** @type {AsyncGenerator<any, void>} */ (
          this.#samples
        ).next();
        if (done || !value) throw new Error("the video ends before it");
        frame = this.#pixels(value);
        value.close();
        this.#kept.set(this.#next++, frame);
        const [oldest] = this.#kept.keys();
        if (this.#kept.size > KEPT) this.#kept.delete(oldest);
      }
      return /** @type {Blob} */ (frame);
    } catch (error) {
      this.#samples = null;
      throw new Error(`frame ${i} of ${this.#path} cannot be decoded (${messageOf(error)})`);
    }
  }

  /** @param {any} sample */
  #pixels(sample) {
    const { displayWidth: width, displayHeight: height } = sample;
    if (this.#canvas.width !== width || this.#canvas.height !== height) {
      Object.assign(this.#canvas, { width, height });
    }
    const context = /** @type {OffscreenCanvasRenderingContext2D} */ (
      this.#canvas.getContext("2d", { willReadFrequently: true, alpha: false })
    );
    sample.draw(context, 0, 0, width, height);
    return arrayOfPixels(context.getImageData(0, 0, width, height));
  }
}
