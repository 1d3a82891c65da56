// @ts-check
/** The GPU: whether the browser has one for us, and the worker that computes on it. */

import { blobOf } from "../files/sources.js";

/**
 * @typedef {import("../files/sources.js").Source} Source
 * @typedef {import("./gpu-worker.js").File} File
 * @typedef {import("./extractor.js").Extracted} Extracted
 * @typedef {import("./gpu-worker.js").Reply} Reply
 *
 * What the browser offers: the name of a GPU, or why there is none.
 * @typedef {{ name: string, missing?: undefined } | { name?: undefined, missing: string }} Adapter
 */

/** Programs that act as a GPU, where the browser does not say so itself. */
const SOFTWARE = /swiftshader|llvmpipe|lavapipe|softpipe|basic render/i;

/**
 * Looks for a GPU; nothing is fetched before there is one.
 * @param {boolean} allowSoftware whether a program that acts as one will do, for tests
 * @returns {Promise<Adapter>}
 */
export async function findAdapter(allowSoftware) {
  const { gpu } = /** @type {any} */ (navigator);
  if (!gpu) return { missing: "this browser has no WebGPU" };
  let adapter = null;
  try {
    adapter = await gpu.requestAdapter({ powerPreference: "high-performance" });
  } catch {
    // As if there were none.
  }
  if (!adapter) return { missing: "WebGPU finds no GPU here" };
  const { vendor, architecture, device, description, isFallbackAdapter } = adapter.info ?? {};
  const name = description || [vendor, architecture, device].filter(Boolean).join(" ") || "unnamed";
  const software =
    isFallbackAdapter || adapter.isFallbackAdapter || SOFTWARE.test([name, architecture].join(" "));
  if (software && !allowSoftware)
    return { missing: `the only GPU here is a program on the CPU (${name})` };
  const part = await fetch(new URL("../pkg/gpu.js", import.meta.url)).catch(() => null);
  return part?.ok
    ? { name }
    : { missing: "this site was built without what a GPU needs (`cargo xtask site --gpu`)" };
}

/**
 * The worker that has the GPU. It is of no use any more once a call was rejected with anything but
 * a signal's reason.
 */
export class GpuWorker {
  #worker = new Worker(new URL("./gpu-worker.js", import.meta.url), { type: "module" });
  #last = 0;
  /** Why it is of no use any more. */
  #closed = "";
  /** @type {Map<number, { resolve: (reply: Reply) => void, reject: (error: unknown) => void }>} */
  #waiting = new Map();

  constructor() {
    this.#worker.onmessage = (/** @type {MessageEvent<Reply>} */ { data }) => {
      const waiting = this.#waiting.get(data.id);
      this.#waiting.delete(data.id);
      if (data.type === "failed") waiting?.reject(new Error(data.message));
      else waiting?.resolve(data);
    };
    this.#worker.onerror = (event) => {
      event.preventDefault();
      this.close(event.message || "its worker could not be started");
    };
  }

  /**
   * Opens a checkpoint in place of the one before.
   * @param {File} checkpoint
   * @param {AbortSignal} signal
   */
  async open(checkpoint, signal) {
    await this.#ask({ type: "open", checkpoint }, signal);
  }

  /**
   * The keypoints of frames, `null` for those that have none here, and the milliseconds it took.
   * @param {Source[]} frames
   * @param {AbortSignal} signal
   * @returns {Promise<{ found: (Extracted | null)[], ms: number }>}
   */
  async extract(frames, signal) {
    // What cannot be unpacked has no keypoints here; the CPU says why.
    const file = async (/** @type {Source} */ frame) => ({
      path: frame.path,
      blob: await blobOf(frame),
    });
    const files = await Promise.all(frames.map((frame) => file(frame).catch(() => null)));
    const reply = await this.#ask({ type: "extract", frames: files }, signal);
    if (reply.type !== "extracted") throw new Error("the worker answered out of turn");
    return reply;
  }

  /** @param {string} [why] */
  close(why = "it was closed") {
    this.#closed ||= why;
    this.#worker.terminate();
    for (const { reject } of this.#waiting.values()) reject(new Error(why));
    this.#waiting.clear();
  }

  /**
   * @param {{ type: "open", checkpoint: File } | { type: "extract", frames: (File | null)[] }}
   * request
   * @param {AbortSignal} signal
   * @returns {Promise<Reply>}
   */
  #ask(request, signal) {
    const id = ++this.#last;
    return new Promise((resolve, reject) => {
      if (signal.aborted) return reject(signal.reason);
      if (this.#closed) return reject(new Error(this.#closed));
      const abort = () => {
        this.#waiting.delete(id);
        reject(signal.reason);
      };
      signal.addEventListener("abort", abort, { once: true });
      const settled = () => signal.removeEventListener("abort", abort);
      this.#waiting.set(id, {
        resolve: (reply) => (settled(), resolve(reply)),
        reject: (error) => (settled(), reject(error)),
      });
      this.#worker.postMessage({ ...request, id });
    });
  }
}
