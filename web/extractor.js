// @ts-check
/**
 * From encoded images to keypoints, whichever way they are computed. What follows knows only {@link Extractor}.
 */

/**
 * @typedef {import("./files.js").Source} Source
 * @typedef {{ points: Float64Array, width: number, height: number }} Extracted
 */

/**
 * @typedef {object} Job
 * @property {Source} checkpoint
 * @property {Source[]} frames
 * @property {AbortSignal} signal
 * @property {(path: string, extracted: Extracted) => void} onFrame
 * @property {(path: string, message: string) => void} onFailure a frame that has no keypoints, and why
 */

/**
 * @typedef {object} Extractor
 * @property {(job: Job) => Promise<void>} extract
 *   Reports every frame once, in any order. Rejects when no frame can be extracted at all, and with the signal's
 *   reason when that aborts; nothing is reported after that.
 */

/** What a worker answers. @typedef {import("./extract-worker.js").Reply} Reply */

/**
 * One worker with the CPU engine, one frame at a time.
 * @type {Extractor}
 */
export const workerExtractor = {
  async extract({ checkpoint, frames, signal, onFrame, onFailure }) {
    /** @type {WorkerLine | null} */
    let line = null;
    try {
      for (const frame of frames) {
        if (!line) {
          line = new WorkerLine(signal);
          const opened = await line.ask({ type: "open", checkpoint });
          if (opened.type !== "opened") throw new Error(messageOf(opened));
        }
        const reply = await line.ask({ type: "extract", frame });
        if (reply.type === "extracted") {
          onFrame(frame.path, reply);
          continue;
        }
        onFailure(frame.path, messageOf(reply));
        if (reply.type === "crashed") {
          // The instance is in an unknown state after a trap: the next frame gets a fresh one.
          line.close();
          line = null;
        }
      }
    } finally {
      line?.close();
    }
  },
};

/** Questions to a worker and their answers, one at a time; an abort ends the worker at once. */
class WorkerLine {
  #worker = new Worker(new URL("./extract-worker.js", import.meta.url), { type: "module" });
  #signal;

  /** @param {AbortSignal} signal */
  constructor(signal) {
    this.#signal = signal;
  }

  /**
   * @param {import("./extract-worker.js").Request} request
   * @returns {Promise<Reply>}
   */
  ask(request) {
    const signal = this.#signal;
    return new Promise((resolve, reject) => {
      const abort = () => {
        this.close();
        reject(signal.reason);
      };
      if (signal.aborted) return abort();
      signal.addEventListener("abort", abort, { once: true });
      /** @param {Reply} reply */
      const settle = (reply) => {
        signal.removeEventListener("abort", abort);
        resolve(reply);
      };
      this.#worker.onmessage = ({ data }) => settle(data);
      this.#worker.onerror = (event) => {
        event.preventDefault();
        settle({ type: "crashed", message: event.message || "the worker could not be started" });
      };
      this.#worker.postMessage(request);
    });
  }

  close() {
    this.#worker.terminate();
  }
}

/** @param {Reply} reply */
function messageOf(reply) {
  if (reply.type === "failed") return reply.message;
  if (reply.type === "crashed") return `the extraction broke down (${reply.message})`;
  return "the worker answered out of turn";
}
