// @ts-check
/**
 * The worker of `gpu.js`: the package's GPU part, which opens the GPU once, and one encoder, a
 * batch of frames at a time.
 */

import { messageOf } from "../errors.js";
import init, { Gpu } from "../pkg/gpu.js";

/**
 * @typedef {{ path: string, blob: Blob }} File
 * @typedef {import("./extractor.js").Extracted} Extracted
 * @typedef {import("../pkg/gpu.js").GpuEncoder} GpuEncoder
 * @typedef {import("../pkg/gpu.js").GpuFrame} GpuFrame
 * @typedef {{ id: number } & ({ type: "open", checkpoint: File } | { type: "extract", frames: (File
 * | null)[] })} Request
 * @typedef {{ id: number } & ({ type: "opened" }
 *   | { type: "extracted", found: (Extracted | null)[], ms: number }
 *   | { type: "failed", message: string })} Reply
 */

/** @type {Gpu | undefined} */
let gpu;
/** @type {GpuEncoder | undefined} */
let encoder;
/** Batches under way. @type {Set<Promise<unknown>>} */
const running = new Set();

self.onmessage = async (/** @type {MessageEvent<Request>} */ { data }) => {
  const { id } = data;
  try {
    if (data.type === "open") {
      await open(data.checkpoint);
      self.postMessage({ id, type: "opened" });
      return;
    }
    const batch = extract(data.frames);
    running.add(batch);
    const reply = await batch.finally(() => running.delete(batch));
    self.postMessage({ id, type: "extracted", ...reply });
  } catch (error) {
    self.postMessage({
      id,
      type: "failed",
      message: messageOf(error),
    });
  }
};

/** @param {File} checkpoint */
async function open(checkpoint) {
  if (!gpu) {
    await init();
    gpu = await Gpu.open();
  }
  const bytes = await bytesOf(checkpoint);
  await Promise.allSettled(running);
  encoder?.free();
  encoder = undefined;
  encoder = gpu.encoder(bytes, checkpoint.path);
}

/**
 * The keypoints of frames, `null` for those that have none here: the CPU says why, or finds them.
 * While the GPU computes, the next request is decoded.
 * @param {(File | null)[]} frames
 */
async function extract(frames) {
  const start = performance.now();
  /** @type {(Extracted | null)[]} */
  const found = frames.map(() => null);
  /** @type {{ index: number, frame: GpuFrame }[]} */
  const prepared = [];
  for (const [index, frame] of frames.entries()) {
    const ready = frame && (await prepare(frame));
    if (ready) prepared.push({ index, frame: ready });
  }
  while (encoder && prepared.length > 0) {
    const batch = prepared.splice(0, Math.min(...prepared.map(({ frame }) => frame.batchLimit)));
    const results = await encoder.extract(batch.map(({ frame }) => frame));
    for (const [i, { index }] of batch.entries()) {
      const result = results[i];
      if (!(result instanceof Error)) found[index] = result;
    }
  }
  return { found, ms: performance.now() - start };
}

/** @param {File} frame */
async function prepare(frame) {
  if (!encoder) throw new Error("no checkpoint was opened");
  try {
    return encoder.prepare(await bytesOf(frame), frame.path);
  } catch (error) {
    // After a trap the instance is in an unknown state.
    if (error instanceof WebAssembly.RuntimeError) throw error;
    return null;
  }
}

/** @param {File} file */
async function bytesOf({ blob }) {
  return new Uint8Array(await blob.arrayBuffer());
}
