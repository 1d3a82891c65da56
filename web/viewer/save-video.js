// @ts-check
/**
 * The sequence on display as a video: its frames with the layers on display, and below them what
 * they mean and how well each object is tracked.
 */

import { mediabunny } from "../files/containers/mediabunny.js";
import { decodeImage } from "../files/image-cache.js";
import { tcText } from "../results/summary.js";
import { integer, significant } from "../ui/format.js";
import { objectColor } from "../ui/palette.js";
import { loadLook } from "./look.js";
import { paint, paintMark } from "./scene.js";
import { tracksOf } from "./tracks.js";
import { WHOLE } from "./view.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./scene.js").Mark} Mark
 * @typedef {import("../pkg/index.js").SequenceRange} SequenceRange
 * @typedef {{ name: string, blob: Blob }} Video
 */

/** Pixels across a video, and those for a CSS pixel of the page. */
const WIDTH = 720;
const SCALE = 1.6;
/** Codecs want even sides. */
const EVEN = 2;
/** Of the lines below the frames. */
const LINE = 30;
const FONT = 18;
const PADDING = 14;
const BACKGROUND = "#15191e";
const FOREGROUND = "#e9edf1";
/** Objects that are named below the frames. */
const MOST_NAMED = 6;
/** In the order in which they are tried: H.264 plays everywhere, and goes into MP4. */
const CODECS = ["avc", "vp9", "vp8", "av1"];

/** @type {[Mark, string][]} */
const MEANINGS = [
  ["truth", "ground truth"],
  ["keypoint", "keypoint"],
  ["transformed", "keypoint, mapped"],
];

/**
 * @param {Session} session
 * @param {(done: number, total: number) => void} onProgress
 * @param {AbortSignal} signal
 * @returns {Promise<Video>}
 */
export async function videoOf(session, onProgress, signal) {
  const { score } = session;
  const range = score.sequenceOf(score.selection.frame);
  if (!range) throw new Error("there is no sequence to be saved");
  const film = new Film(session, range);
  await film.prepare();
  const { library, codec } = await encoderFor(film.canvas);
  const { BufferTarget, CanvasSource, Mp4OutputFormat, Output, QUALITY_HIGH } = library;
  const format = codec === "avc" ? new Mp4OutputFormat() : new library.WebMOutputFormat();
  const output = new Output({ format, target: new BufferTarget() });
  const frames = new CanvasSource(film.canvas, { codec, bitrate: QUALITY_HIGH });
  output.addVideoTrack(frames);
  await output.start();
  try {
    for (let i = 0; i < range.length; i++) {
      signal.throwIfAborted();
      onProgress(i, range.length);
      await film.draw(i);
      await frames.add(i / film.speed, 1 / film.speed);
    }
    await output.finalize();
  } catch (error) {
    await output.cancel();
    throw error;
  }
  const name = `${range.name}${format.fileExtension}`.replace(/[^\w.-]+/g, "_");
  return { name, blob: new Blob([output.target.buffer], { type: format.mimeType }) };
}

/**
 * The library, and a codec that this browser encodes.
 * @param {{ width: number, height: number }} size
 */
async function encoderFor({ width, height }) {
  if (!("VideoEncoder" in globalThis)) {
    throw new Error(
      "this browser cannot encode videos here; expected Chrome or Edge 94, Firefox 130, Safari " +
        "16.4 or later, and the page from https:// or localhost",
    );
  }
  const library = await mediabunny();
  if (!library) throw new Error("the page’s writer of videos could not be fetched; try again");
  const bitrate = library.QUALITY_HIGH;
  const codec = await library.getFirstEncodableVideoCodec(CODECS, { width, height, bitrate });
  if (!codec) {
    throw new Error(
      `this browser encodes none of H.264, VP9, VP8 and AV1 at ${width} x ${height} pixels`,
    );
  }
  return { library, codec };
}

/** Draws the frames of a sequence one by one, as they were on display when it was made. */
class Film {
  canvas = new OffscreenCanvas(1, 1);
  /** Frames per second. */
  speed;

  #session;
  #range;
  #look = loadLook();
  #tracks;
  #pictures;
  #numbers;
  #tc;
  #lines;
  #stage = new OffscreenCanvas(1, 1);

  /**
   * @param {Session} session
   * @param {SequenceRange} range
   */
  constructor(session, range) {
    const { score } = session;
    this.#session = session;
    this.#range = range;
    this.speed = this.#look.speed;
    this.#tracks = tracksOf(session);
    const frames = Array.from({ length: range.length }, (_, i) => range.start + i);
    this.#pictures = frames.map((frame) => score.picture(frame));
    this.#numbers = frames.map((frame) => score.frameNumbers[frame]);
    const { evaluation } = score;
    this.#tc = evaluation ? `TC ${tcText(evaluation.tc)}` : "";
    this.#lines = linesOf(session, this.#look.layers);
  }

  /** Takes the size of the first frame. */
  async prepare() {
    const image = await this.#image(0);
    const [width, height] = image
      ? [image.width, image.height]
      : (this.#session.score.imageSize ?? [1, 1]);
    image?.close();
    const even = (/** @type {number} */ pixels) => EVEN * Math.max(1, Math.round(pixels / EVEN));
    Object.assign(this.#stage, { width: WIDTH, height: even((WIDTH * height) / width) });
    const below = (1 + this.#lines.length) * LINE + PADDING;
    Object.assign(this.canvas, { width: WIDTH, height: this.#stage.height + even(below) });
  }

  /** @param {number} i in the sequence */
  async draw(i) {
    const frame = this.#range.start + i;
    const { layers, trail } = this.#look;
    const image = await this.#image(i);
    const stage = contextOf(this.#stage);
    paint(stage, SCALE, {
      image,
      caption: image || !this.#pictures[i] ? "" : "no image of this frame",
      view: WHOLE,
      tracks: this.#tracks,
      start: Math.max(this.#range.start, frame - trail),
      frame,
      layers,
      keypoints: this.#session.score.keypointsAt(frame),
      hovered: null,
      heat: null,
    });
    image?.close();
    const context = contextOf(this.canvas);
    context.fillStyle = BACKGROUND;
    context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    context.drawImage(this.#stage, 0, 0);
    this.#write(context, `${this.#range.name}, frame ${integer(this.#numbers[i])}`);
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {string} title
   */
  #write(context, title) {
    let y = this.#stage.height + PADDING / 2 + LINE / 2;
    context.font = `600 ${FONT}px system-ui, sans-serif`;
    context.textBaseline = "middle";
    context.fillStyle = FOREGROUND;
    context.textAlign = "right";
    context.fillText(this.#tc, WIDTH - PADDING, y);
    const space = WIDTH - 3 * PADDING - context.measureText(this.#tc).width;
    context.textAlign = "left";
    context.fillText(title, PADDING, y, space);
    context.font = `${FONT}px system-ui, sans-serif`;
    for (const line of this.#lines) {
      y += LINE;
      const cell = (WIDTH - 2 * PADDING) / line.length;
      for (const [at, { mark, color, text }] of line.entries()) {
        const x = PADDING + at * cell;
        if (mark) paintMark(context, 1, { x: x + FONT / 2, y }, mark, color);
        context.fillStyle = mark ? FOREGROUND : color;
        const indent = mark ? FONT + PADDING / 2 : 0;
        context.fillText(text, x + indent, y, cell - indent - PADDING / 2);
      }
    }
  }

  /**
   * @param {number} i in the sequence
   * @returns {Promise<ImageBitmap | null>}
   */
  async #image(i) {
    const source = this.#pictures[i];
    return source ? decodeImage(source).catch(() => null) : null;
  }
}

/**
 * What the marks mean, and the errors of the objects.
 * @param {Session} session
 * @param {Set<import("./scene.js").Layer>} layers
 * @returns {{ mark: Mark | null, color: string, text: string }[][]}
 */
function linesOf({ score }, layers) {
  const marks = MEANINGS.filter(([mark]) => layers.has(mark));
  const meanings = marks.map(([mark, text]) => ({ mark, color: FOREGROUND, text }));
  const results = score.evaluation?.objects ?? [];
  const objects = results.slice(0, MOST_NAMED).map(({ name, error }, object) => {
    return { mark: null, color: objectColor(object), text: `${name} ${significant(error)}` };
  });
  return [meanings, objects].filter((line) => line.length > 0);
}

/**
 * @param {OffscreenCanvas} canvas
 * @returns {CanvasRenderingContext2D}
 */
function contextOf(canvas) {
  const context = canvas.getContext("2d", { alpha: false });
  if (!context) throw new Error("this browser gives no canvas to draw the video on");
  // What is drawn here needs nothing that only a canvas of the page has.
  return /** @type {CanvasRenderingContext2D} */ (/** @type {unknown} */ (context));
}
