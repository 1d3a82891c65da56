// @ts-check
/**
 * What goes on inside the autoencoder: the heat map behind a keypoint, and the image that the
 * decoder makes of all of them. A worker of their own computes them, so that the page stays
 * responsive.
 */

import { messageOf } from "../errors.js";
import { blobOf, readError } from "../files/sources.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../files/sources.js").Source} Source
 * @typedef {import("./scene.js").Heat} Heat
 * @typedef {{ width: number, height: number, weights: Float32Array }} Weights
 * @typedef {{ path: string, blob: Blob }} Given
 * @typedef {{ kind: "heat", checkpoint: Given, frame: Given, keypoint: number }
 *   | { kind: "image", checkpoint: Given, points: Float64Array }} Question
 * @typedef {{ map: Weights } | { image: ImageData } | { problem: string }} Answer
 */

/** Heat maps and images of the frames last shown that are kept. */
const KEPT = 48;

/** From the faintest to the strongest weight: red, green, blue, alpha. */
const RAMP = [
  [88, 24, 148, 0],
  [150, 36, 150, 120],
  [232, 84, 80, 190],
  [252, 176, 60, 220],
  [255, 248, 190, 235],
];

export class Inside {
  /** @type {Worker | null} */
  #worker = null;
  #onChange;
  /** In the order of last use. @type {Map<string, Heat | ImageData | null>} */
  #known = new Map();
  /**
   * What is to be asked when the worker is free: of each kind only the last question.
   * @type {Map<string, () => void>}
   */
  #next = new Map();
  #busy = false;

  /**
   * @param {(problem: string) => void} onChange something more is there, or cannot be made and why
   */
  constructor(onChange) {
    this.#onChange = onChange;
  }

  /**
   * Whether the keypoints come from a checkpoint that is there, and so from heat maps.
   * @param {Session} session
   */
  static hasHeat(session) {
    return (
      isExtracted(session) && session.encoder?.info.heatMaps === true && session.score.hasPictures
    );
  }

  /**
   * Whether the keypoints come from a checkpoint with a decoder.
   * @param {Session} session
   */
  static hasImage(session) {
    return isExtracted(session) && session.encoder?.info.decoder === true;
  }

  /**
   * The heat map of the keypoint on display; `null` if it is not there yet: then it is made and
   * told.
   * @param {Session} session
   * @param {number} frame
   */
  heat(session, frame) {
    const source = session.score.picture(frame);
    const keypoint = session.score.keypointOf(session.score.selection.object);
    if (!Inside.hasHeat(session) || !source || keypoint === null) return null;
    const ask = async (/** @type {Given} */ checkpoint) => ({
      kind: /** @type {const} */ ("heat"),
      checkpoint,
      frame: await given(source),
      keypoint,
    });
    const found = this.#of(session, `heat ${keypoint} ${frame}`, ask, (answer) =>
      "map" in answer ? placed(answer.map, session, frame) : null,
    );
    return /** @type {Heat | null} */ (found);
  }

  /**
   * What the decoder makes of the keypoints of a frame; `null` if it is not there yet: then it is
   * made and told.
   * @param {Session} session
   * @param {number} frame
   */
  image(session, frame) {
    const points = session.score.scoring?.keypointsAt(frame);
    if (!Inside.hasImage(session) || !points) return null;
    const ask = async (/** @type {Given} */ checkpoint) => ({
      kind: /** @type {const} */ ("image"),
      checkpoint,
      points,
    });
    const found = this.#of(session, `image ${frame}`, ask, (answer) =>
      "image" in answer ? answer.image : null,
    );
    return /** @type {ImageData | null} */ (found);
  }

  /** Forgets everything and ends the worker. */
  clear() {
    this.#worker?.terminate();
    this.#worker = null;
    this.#busy = false;
    this.#next.clear();
    this.#known.clear();
  }

  /**
   * @param {Session} session
   * @param {string} key
   * @param {(checkpoint: Given) => Promise<Question>} ask
   * @param {(answer: Answer) => Heat | ImageData | null} take
   */
  #of(session, key, ask, take) {
    const known = this.#known.get(key);
    if (known !== undefined) {
      this.#known.delete(key);
      this.#known.set(key, known);
      return known;
    }
    const checkpoint = session.library.used("checkpoint")?.source;
    if (!checkpoint) return null;
    // Of each kind only the last question counts.
    this.#next.set(key.split(" ")[0], () => {
      if (this.#known.has(key)) return;
      const question = given(checkpoint).then(ask);
      void this.#ask(question, (answer) => {
        this.#known.set(key, take(answer));
        const [oldest] = this.#known.keys();
        if (this.#known.size > KEPT) this.#known.delete(oldest);
        this.#onChange("problem" in answer ? answer.problem : "");
      });
    });
    this.#advance();
    return null;
  }

  #advance() {
    while (!this.#busy && this.#next.size > 0) {
      const [[kind, next]] = this.#next;
      this.#next.delete(kind);
      next();
    }
  }

  /**
   * @param {Promise<Question>} question
   * @param {(answer: Answer) => void} onAnswer
   */
  async #ask(question, onAnswer) {
    this.#busy = true;
    this.#worker ??= new Worker(new URL("./inside-worker.js", import.meta.url), { type: "module" });
    const worker = this.#worker;
    const settle = (/** @type {Answer} */ answer) => {
      this.#busy = false;
      onAnswer(answer);
      this.#advance();
    };
    worker.onmessage = ({ data }) => settle(data);
    worker.onerror = (event) => {
      event.preventDefault();
      // Its state is unknown: the next question gets a fresh one.
      worker.terminate();
      this.#worker = null;
      const reason = event.message || "the worker could not be started";
      settle({ problem: `That could not be computed (${reason}).` });
    };
    try {
      worker.postMessage(await question);
    } catch (error) {
      // Unless everything was cleared meanwhile.
      if (worker === this.#worker) settle({ problem: messageOf(error) });
    }
  }
}

/**
 * Whether the keypoints that are scored come from the checkpoint.
 * @param {Session} session
 */
function isExtracted({ encoder, library, score }) {
  return score.scoring !== null && encoder !== null && !library.used("keypoints");
}

/**
 * A file as a worker can be given it.
 * @param {Source} source
 * @returns {Promise<Given>}
 */
async function given(source) {
  try {
    return { path: source.path, blob: await blobOf(source) };
  } catch (error) {
    throw new Error(readError(error, source.path));
  }
}

/**
 * The map as an image, with the place of its cells in the frame.
 * @param {Weights} map
 * @param {Session} session
 * @param {number} frame
 * @returns {Heat}
 */
function placed({ width, height, weights }, session, frame) {
  const canvas = document.createElement("canvas");
  Object.assign(canvas, { width, height });
  const pixels = new ImageData(width, height);
  const most = weights.reduce((most, weight) => Math.max(most, weight), 0);
  for (const [i, weight] of weights.entries()) {
    // A root, as a sharp map is one bright cell otherwise.
    const share = Math.sqrt(weight / most) * (RAMP.length - 1);
    const step = Math.min(Math.floor(share), RAMP.length - 2);
    for (let c = 0; c < 4; c++) {
      pixels.data[4 * i + c] = RAMP[step][c] + (share - step) * (RAMP[step + 1][c] - RAMP[step][c]);
    }
  }
  canvas.getContext("2d")?.putImageData(pixels, 0, 0);
  const [left, top, right, bottom] = session.score.placed(new Float64Array([-1, -1, 1, 1]), frame);
  // The points are the centres of the border cells, half a cell inside of the map's edges.
  const cell = {
    x: (right - left) / 2 / Math.max(width - 1, 1),
    y: (bottom - top) / 2 / Math.max(height - 1, 1),
  };
  return {
    image: canvas,
    left: (left + 1) / 2 - cell.x / 2,
    top: (top + 1) / 2 - cell.y / 2,
    width: cell.x * width,
    height: cell.y * height,
  };
}
