// @ts-check
/** The keypoints of frames under one checkpoint: those that are there, and the run that makes the others. */

/**
 * @typedef {import("./files.js").Source} Source
 * @typedef {import("./extractor.js").Extracted} Extracted
 * @typedef {import("./extractor.js").OpenEncoder} OpenEncoder
 * @typedef {"idle" | "running" | "cancelled" | "failed"} Status
 */

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
      this.error = error instanceof Error ? error.message : String(error);
      return false;
    }
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

  /** Frames a second in this run, 0 before the first one is done. */
  get rate() {
    const seconds = (performance.now() - this.#started) / 1000;
    return this.#doneInRun > 0 ? this.#doneInRun / seconds : 0;
  }
}
