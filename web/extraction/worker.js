// @ts-check
/**
 * A worker of `extraction-pool.js`: its own instance of the extraction, one encoder, a frame at a
 * time.
 */

import { messageOf } from "../errors.js";
import { PartError, decodable, memoryOfDecoding } from "./decodable.js";
import init, { Encoder, extractionMemory } from "../pkg/index.js";

/**
 * @typedef {{ path: string, blob: Blob }} File `refuse`: what was to be extracted could not be
 * unpacked. `lacking`: what the worker itself needs is not there.
 * @typedef {{ type: "open", module: WebAssembly.Module, source: File } | { type: "extract", source:
 * File }
 *   | { type: "refuse", message: string }} Request
 * @typedef {{ type: "started" }
 *   | { type: "opened", info: import("../pkg/index.js").EncoderInfo, memory: number }
 *   | ({ type: "extracted", memory: number } & import("./extractor.js").Extracted)
 *   | { type: "failed", message: string }
 *   | { type: "lacking", message: string }
 *   | { type: "crashed", message: string }} Reply
 */

const READABLE = 2 ** 31;

/** @type {Encoder | undefined} */
let encoder;
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
    if (request.type === "open") {
      await init({ extraction: request.module });
      encoder = new Encoder(await bytes, path);
      return { type: "opened", info: encoder.info, memory: extractionMemory() };
    }
    if (!encoder) throw new Error("no checkpoint was opened");
    const extraction = encoder.extract(await decodable(await bytes, path), path);
    const { points, width, height } = extraction;
    extraction.free();
    return {
      type: "extracted",
      points,
      width,
      height,
      memory: extractionMemory() + memoryOfDecoding(),
    };
  } catch (error) {
    const message = messageOf(error);
    if (error instanceof PartError) return { type: "lacking", message };
    if (!(error instanceof WebAssembly.RuntimeError)) return { type: "failed", message };
    // After a trap the instance is in an unknown state.
    return { type: "crashed", message: `${message}, as when memory runs out` };
  }
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
