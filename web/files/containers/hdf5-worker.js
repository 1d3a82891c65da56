// @ts-check
/**
 * An HDF5 file that is read by slices, as a worker can: files are larger than a page's memory.
 */

import { messageOf } from "../../errors.js";
import init, { Hdf5File } from "../../pkg/index.js";

/**
 * @typedef {import("../../pkg/index.js").FormatPoints} FormatPoints
 *
 * What is asked of the file; each request has an answer of the same number. Of several cameras the
 * one asked for is opened, or else the first.
 * @typedef {{ module: WebAssembly.Module, path: string, blob: Blob, camera?: string }} File
 * @typedef {{ number: number } & (({ type: "open" } & File) | { type: "frame", frame: number })}
 * Request
 *
 * `cameras`: all of them, where there are several. `problem`: why the frames cannot be used.
 * @typedef {{ paths: string[], points: FormatPoints | null, cameras: string[], problem: string }}
 * Opened
 * @typedef {{ number: number } & ({ opened: Opened } | { frame: Uint8Array<ArrayBuffer> } | { error:
 * string })} Reply
 */

/** @type {Hdf5File | undefined} */
let file;
/** Requests are answered one after the other. */
let last = Promise.resolve();

self.onmessage = (/** @type {MessageEvent<Request>} */ { data }) => {
  last = last.then(async () => {
    const reply = await answer(data);
    self.postMessage(reply, { transfer: "frame" in reply ? [reply.frame.buffer] : [] });
  });
};

/**
 * @param {Request} request
 * @returns {Promise<Reply>}
 */
async function answer(request) {
  const { number } = request;
  try {
    if (request.type === "open") return { number, opened: await open(request) };
    const frame = file?.frame(request.frame) ?? new Uint8Array();
    return { number, frame: /** @type {Uint8Array<ArrayBuffer>} */ (frame) };
  } catch (error) {
    return { number, error: messageOf(error) };
  }
}

/**
 * @param {File} request
 * @returns {Promise<Opened>}
 */
async function open({ module, path, blob, camera }) {
  await init({ formats: module });
  // Only workers have it, and so the types of a page do not.
  const reader = new (Reflect.get(globalThis, "FileReaderSync"))();
  const read = (/** @type {number} */ start, /** @type {number} */ length) =>
    new Uint8Array(reader.readAsArrayBuffer(blob.slice(start, start + length)));
  file = Hdf5File.open(read, blob.size, path);
  const { cameras } = file;
  if (cameras.length > 0) {
    file.free();
    file = Hdf5File.open(read, blob.size, path, camera ?? cameras[0]);
  }
  return { paths: file.paths, points: file.points(), cameras, problem: file.problem };
}
