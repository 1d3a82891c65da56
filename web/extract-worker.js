// @ts-check
/** The worker of `extractor.js`: its own instance of the package, one encoder, a frame at a time. */

import init, { Encoder } from "./pkg/index.js";

/**
 * @typedef {import("./files.js").Source} Source
 * @typedef {{ type: "open", checkpoint: Source } | { type: "extract", frame: Source }} Request
 * @typedef {{ type: "opened" }
 *   | ({ type: "extracted" } & import("./extractor.js").Extracted)
 *   | { type: "failed", message: string }
 *   | { type: "crashed", message: string }} Reply
 */

/** @type {Encoder | undefined} */
let encoder;

self.onmessage = async (/** @type {MessageEvent<Request>} */ { data }) => {
  self.postMessage(await answer(data));
};

/**
 * @param {Request} request
 * @returns {Promise<Reply>}
 */
async function answer(request) {
  try {
    if (request.type === "open") {
      await init();
      encoder = new Encoder(await bytesOf(request.checkpoint), request.checkpoint.path);
      return { type: "opened" };
    }
    if (!encoder) throw new Error("no checkpoint was opened");
    const { points, width, height } = encoder.extract(await bytesOf(request.frame), request.frame.path);
    return { type: "extracted", points, width, height };
  } catch (error) {
    const message = error instanceof Error ? error.message : String(error);
    return { type: error instanceof WebAssembly.RuntimeError ? "crashed" : "failed", message };
  }
}

/** @param {Source} source */
async function bytesOf({ path, blob }) {
  try {
    return new Uint8Array(await blob.arrayBuffer());
  } catch {
    throw new Error(`${path} can no longer be read: it was changed or removed after it was dropped; drop it again`);
  }
}
