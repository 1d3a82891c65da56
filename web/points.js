// @ts-check
/**
 * Frames with what is known of them: joined points, images, the grid of an encoder. Where points
 * are still missing, what is there can be looked at already.
 */

import { latentToImage } from "./pkg/index.js";

/**
 * @typedef {import("./files/sources.js").Source} Source
 * @typedef {import("./pkg/index.js").ScoreOptions} ScoreOptions
 * @typedef {import("./pkg/index.js").Scoring} Scoring
 * @typedef {import("./pkg/index.js").SequenceRange} SequenceRange
 * @typedef {import("./pkg/index.js").Series & { distances: Float64Array }} Series
 *
 * @typedef {object} Parts
 * @property {Scoring | null} scoring `null` where there is no ground truth yet
 * @property {SequenceRange[]} sequences the frames by sequence
 * @property {Float64Array} frameNumbers for each frame its number in its sequence
 * @property {(Source | null)[]} pictures for each frame its image; empty: there are none
 * @property {[number, number][]} sizes width and height by frame, or one for all; empty: not known
 * @property {string | null} config of the encoder whose latent space the keypoints are in
 */

/** Series of this many pairs of object and keypoint are kept: those of all objects on display. */
const KEPT_SERIES = 32;

export class Points {
  scoring;
  /** @type {string[]} */
  objects;
  sequences;
  frameNumbers;

  #pictures;
  #sizes;
  #config;
  /** The last ones asked for. @type {Map<string, Series>} */
  #series = new Map();

  /** @param {Parts} parts */
  constructor({ scoring, sequences, frameNumbers, pictures, sizes, config }) {
    this.scoring = scoring;
    this.objects = scoring?.objects ?? [];
    /** The numbers of coordinates of a keypoint and of an object. @type {number[]} */
    this.axes = scoring ? Array.from(scoring.axes) : [2, 2];
    this.sequences = sequences;
    this.frameNumbers = frameNumbers;
    this.#pictures = pictures;
    this.#sizes = sizes;
    // Only points in the image have a place in it.
    this.#config = this.axes[0] === 2 ? config : null;
  }

  /** Forgets what belongs to other options. */
  forgetSeries() {
    this.#series.clear();
  }

  /** Width and height of the images, when it is known and the same for all. */
  get imageSize() {
    return this.#sizes.length === 1 ? this.#sizes[0] : null;
  }

  /**
   * Whether raw keypoints are shown where the encoder's grid places them; otherwise they are taken
   * as ndc.
   */
  get placesKeypoints() {
    return this.#config !== null && this.#sizes.length > 0;
  }

  /**
   * The image of a frame.
   * @param {number} frame
   */
  picture(frame) {
    return this.#pictures[frame] ?? null;
  }

  /** Whether any frame has an image. */
  get hasPictures() {
    return this.#pictures.some((picture) => picture !== null);
  }

  /**
   * The sequence a frame belongs to.
   * @param {number} frame
   * @returns {SequenceRange | null}
   */
  sequenceOf(frame) {
    return (
      this.sequences.find(({ start, length }) => frame >= start && frame < start + length) ?? null
    );
  }

  /**
   * The points of an object and a keypoint, in ndc or in space, with their squared distances.
   * @param {number} object
   * @param {number} keypoint
   * @param {ScoreOptions} options what decides on the map
   */
  series(object, keypoint, options) {
    if (!this.scoring) return null;
    const key = `${object} ${keypoint}`;
    let series = this.#series.get(key);
    if (series) {
      // The oldest is the one not asked for longest.
      this.#series.delete(key);
    } else {
      const { truth, keypoint: raw, transformed } = this.scoring.series(object, keypoint, options);
      const distances = this.scoring.distances(object, keypoint, options);
      series = { truth, keypoint: this.#place(raw), transformed, distances };
      const [oldest] = this.#series.keys();
      if (this.#series.size >= KEPT_SERIES) this.#series.delete(oldest);
    }
    this.#series.set(key, series);
    return series;
  }

  /**
   * Where an object is, while no keypoint is known; `null` for one that is visible in no frame.
   * @param {number} object
   * @returns {Series | null}
   */
  truthOf(object) {
    const truth = this.#truthOf(object);
    if (!truth) return null;
    const unknown = new Float64Array(truth.length).fill(NaN);
    const distances = new Float64Array(truth.length / this.axes[1]).fill(NaN);
    return { truth, keypoint: unknown, transformed: unknown, distances };
  }

  /** @param {number} object */
  #truthOf(object) {
    try {
      // Any map will do: only the truth is taken.
      const transform = this.axes[0] === this.axes[1] ? "identity" : "affine";
      return this.scoring?.series(object, 0, { transform }).truth ?? null;
    } catch {
      // The package has no series of an object that is visible nowhere.
      return null;
    }
  }

  /**
   * All keypoints of a frame in ndc, N x 2; none where they are in space.
   * @param {number} frame
   */
  keypointsAt(frame) {
    if (this.axes[0] !== 2) return new Float64Array();
    return this.scoring ? this.placed(this.scoring.keypointsAt(frame), frame) : new Float64Array();
  }

  /**
   * Points of a frame in ndc; see {@link Points.placesKeypoints}.
   * @param {Float64Array} points
   * @param {number} frame
   */
  placed(points, frame) {
    const size = this.imageSize ?? this.#sizes[frame];
    return this.#config !== null && size ? latentToImage(this.#config, points, ...size) : points;
  }

  /**
   * Latent points of the frames in the image.
   * @param {Float64Array} points
   */
  #place(points) {
    if (this.#config === null || this.#sizes.length === 0) return points;
    if (this.imageSize) return latentToImage(this.#config, points, ...this.imageSize);
    const placed = new Float64Array(points.length);
    for (let t = 0; t < this.#sizes.length; t++)
      placed.set(this.placed(points.slice(2 * t, 2 * t + 2), t), 2 * t);
    return placed;
  }
}
