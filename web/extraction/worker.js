// @ts-check
/**
 * A worker of `pool.js`: its own instance of a part of the package, one encoder or detector, a frame
 * at a time.
 */

import { messageOf, reasonOf } from "../errors.js";
import { PartError, decodable, memoryOfDecoding } from "./decodable.js";
import init, { Detector, Encoder, detectorMemory, extractionMemory } from "../pkg/index.js";

/**
 * @typedef {import("./extractor.js").Given} Given
 * @typedef {import("./extractor.js").Info} Info
 * @typedef {"extraction" | "onnx"} Part of the package
 *
 * `refuse`: what was to be extracted could not be unpacked. `lacking`: what the worker itself needs
 * is not there.
 * @typedef {{ path: string, blob: Blob }} File
 * @typedef {{ type: "open", part: Part, module: WebAssembly.Module, source: Given }
 *   | { type: "extract", source: File }
 *   | { type: "refuse", message: string }} Request
 * @typedef {{ type: "started" }
 *   | { type: "opened", info: Info, memory: number }
 *   | ({ type: "extracted", memory: number } & import("./extractor.js").Extracted)
 *   | { type: "failed", message: string, cause?: import("../errors.js").Reason | null }
 *   | { type: "lacking", message: string }
 *   | { type: "crashed", message: string }} Reply
 */

const READABLE = 2 ** 31;

/**
 * The encoder or detector, once it is open, and the memory of its part.
 * @type {{ of: Encoder | Detector, memory: () => number } | undefined}
 */
let open;
/** Requests are answered one after the other. */
let last = started();

self.onmessage = (/** @type {MessageEvent<Request>} */ { data }) => {
  // Read while the request before is computed; a failure is reported in its turn.
  const bytes = data.type === "refuse" ? Promise.resolve(new Uint8Array()) : bytesOf(data.source);
  bytes.catch(() => {});
  last = last.then(async () => {
    const reply = await answer(data, bytes);
    self.postMessage(reply, { transfer: reply.type === "extracted" ? [reply.points.buffer] : [] });
  });
};

/**
 * Holds a lock for as long as the worker lives: nothing else tells the page of a worker that ended
 * without a word.
 */
async function started() {
  if (navigator.locks) {
    await new Promise((held) => {
      void navigator.locks.request(self.name, () => {
        held(undefined);
        return new Promise(() => {});
      });
    });
  }
  self.postMessage({ type: "started" });
}

/**
 * @param {Request} request
 * @param {Promise<Uint8Array>} bytes
 * @returns {Promise<Reply>}
 */
async function answer(request, bytes) {
  try {
    if (request.type === "refuse") return { type: "failed", message: request.message };
    const { path } = request.source;
    if (request.type === "open") return await opened(request, await bytes);
    if (!open) throw new Error("no checkpoint was opened");
    const extraction = open.of.extract(await decodable(await bytes, path), path);
    const { points, width, height } = extraction;
    const confidences = "confidences" in extraction ? extraction.confidences : undefined;
    extraction.free();
    const memory = open.memory() + memoryOfDecoding();
    return { type: "extracted", points, confidences, width, height, memory };
  } catch (error) {
    const message = messageOf(error);
    if (error instanceof PartError) return { type: "lacking", message };
    if (!(error instanceof WebAssembly.RuntimeError))
      return { type: "failed", message, cause: reasonOf(error) };
    // After a trap the instance is in an unknown state.
    return { type: "crashed", message: `${message}, as when memory runs out` };
  }
}

/**
 * @param {Extract<Request, { type: "open" }>} request
 * @param {Uint8Array} bytes
 * @returns {Promise<Reply>}
 */
async function opened({ part, module, source: { path, settings } }, bytes) {
  await init({ [part]: module });
  let info;
  if (part === "onnx") {
    const detector = new Detector(bytes, path, settings);
    open = { of: detector, memory: detectorMemory };
    info = { ...detector.info, decoder: false, heatMaps: false };
  } else {
    const encoder = new Encoder(bytes, path);
    open = { of: encoder, memory: extractionMemory };
    info = { ...encoder.info, heatMaps: true };
  }
  return { type: "opened", info, memory: open.memory() };
}

/** @param {File} source */
async function bytesOf({ path, blob }) {
  try {
    return new Uint8Array(await blob.arrayBuffer());
  } catch {
    if (blob.size >= READABLE)
      throw new Error(`${path} is larger than the 2 GiB that browsers read at once`);
    throw new Error(
      `${path} can no longer be read: it was changed or removed after it was dropped; drop it ` +
        "again",
    );
  }
}
