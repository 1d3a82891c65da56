// @ts-check
/**
 * The keypoints of frames under one checkpoint: those that are there, and the run that makes the
 * others.
 */

import { messageOf } from "../errors.js";
import { KeypointTable } from "../pkg/index.js";

/**
 * @typedef {import("../files/sources.js").Source} Source
 * @typedef {import("../pkg/index.js").FrameIndex} FrameIndex
 * @typedef {import("./extractor.js").Extracted} Extracted
 * @typedef {import("./extractor.js").OpenEncoder} OpenEncoder
 * @typedef {"idle" | "running" | "cancelled" | "failed"} Status
 */

/** Seconds of a run before its rate means anything: workers are still starting. */
const ESTIMATE_AFTER = 1;

/** Results are kept by path, so a run that was cancelled goes on where it stopped. */
export class Extraction {
  /** @type {Status} */
  status = "idle";
  /** Why no frame could be extracted, when `status` is `failed`. */
  error = "";
  /** @type {Map<string, Extracted>} */
  extracted = new Map();
  /** @type {Map<string, string>} Why a frame has no keypoints, by path. */
  failures = new Map();

  #encoder;
  /** @type {AbortController | null} */
  #abort = null;
  #started = 0;
  #doneInRun = 0;

  /** @param {OpenEncoder} encoder */
  constructor(encoder) {
    this.#encoder = encoder;
  }

  /**
   * The frames without a result yet.
   * @param {Source[]} frames
   */
  pending(frames) {
    return frames.filter(({ path }) => !this.extracted.has(path) && !this.failures.has(path));
  }

  /**
   * Extracts what is pending.
   * @param {Source[]} frames
   * @param {() => void} onProgress called after every frame
   * @returns {Promise<boolean>} whether every frame has a result now
   */
  async run(frames, onProgress) {
    const abort = new AbortController();
    this.#abort = abort;
    this.status = "running";
    this.#started = performance.now();
    this.#doneInRun = 0;
    const report = () => {
      this.#doneInRun++;
      onProgress();
    };
    try {
      await this.#encoder.extract({
        frames: this.pending(frames),
        signal: abort.signal,
        onFrame: (path, extracted) => {
          this.extracted.set(path, extracted);
          report();
        },
        onFailure: (path, message) => {
          this.failures.set(path, message);
          report();
        },
      });
      this.status = "idle";
      return true;
    } catch (error) {
      if (abort.signal.aborted) return false;
      this.status = "failed";
      this.error = messageOf(error);
      return false;
    }
  }

  /**
   * The keypoints as a table; `null` when no frame has any. `selected` is made when some have none,
   * and to be freed too.
   * @param {FrameIndex} frames
   * @param {Source[]} sources the images of `frames`, in their order
   * @returns {{ table: KeypointTable, selected: FrameIndex | null, sources: Source[] } | null}
   */
  collect(frames, sources) {
    const good = Array.from(sources.keys()).filter((i) => this.extracted.has(sources[i].path));
    if (good.length === 0) return null;
    const selected = good.length < sources.length ? frames.select(Uint32Array.from(good)) : null;
    const kept = good.map((i) => sources[i]);
    const { keypoints } = this.#encoder.info;
    const points = new Float64Array(kept.length * keypoints * 2);
    const areSure = kept.every(({ path }) => this.extracted.get(path)?.confidences);
    const confidences = areSure ? new Float64Array(kept.length * keypoints) : undefined;
    for (const [i, { path }] of kept.entries()) {
      const found = this.extracted.get(path);
      points.set(found?.points ?? [], i * keypoints * 2);
      confidences?.set(found?.confidences ?? [], i * keypoints);
    }
    return {
      table: KeypointTable.fromExtraction(selected ?? frames, points, keypoints, confidences),
      selected,
      sources: kept,
    };
  }

  /**
   * Ends the run at once; what is extracted stays.
   * @param {"idle" | "cancelled"} status
   */
  stop(status) {
    if (this.status !== "running") return;
    this.status = status;
    this.#abort?.abort();
  }

  /**
   * Forgets a frame, because another file took its path or it was removed.
   * @param {string} path
   */
  forget(path) {
    this.extracted.delete(path);
    this.failures.delete(path);
  }

  /**
   * Keeps the result of a frame whose image has another path now.
   * @param {string} before
   * @param {string} path
   */
  move(before, path) {
    const extracted = this.extracted.get(before);
    if (extracted) this.extracted.set(path, extracted);
    const failure = this.failures.get(before);
    if (failure !== undefined) this.failures.set(path, failure);
    this.forget(before);
  }

  /** Frames per second in this run; 0 until it can be estimated. */
  get rate() {
    const seconds = (performance.now() - this.#started) / 1000;
    return this.#doneInRun > 0 && seconds >= ESTIMATE_AFTER ? this.#doneInRun / seconds : 0;
  }
}
