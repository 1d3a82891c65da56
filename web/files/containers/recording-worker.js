// @ts-check
/**
 * A recording that is read piece by piece, as a worker can: recordings are larger than a page's
 * memory.
 */

import { messageOf } from "../../errors.js";
import init, { Hdf5File, ZarrFile } from "../../pkg/index.js";

/**
 * @typedef {import("../../pkg/index.js").FormatPoints} FormatPoints
 *
 * A file of an archive or a folder, `path` from the root of what it belongs to.
 * @typedef {{ path: string, blob: Blob }} Member
 *
 * What a recording lies in: an HDF5 file, or a Zarr hierarchy in a ZIP archive or in a folder.
 * @typedef {{ kind: "hdf5" | "zarr", blob: Blob } | { kind: "zarr", files: Member[] }} Place
 *
 * What is asked of the recording; each request has an answer of the same number. Of several cameras
 * the one asked for is opened, or else the first.
 * @typedef {{ module: WebAssembly.Module, path: string, place: Place, camera?: string }} ToOpen
 * @typedef {{ number: number } & (({ type: "open" } & ToOpen)
 *   | { type: "frame", frame: number }
 *   | { type: "named", columns: string })} Request
 *
 * `cameras`: all of them, where there are several. `problem`: why the frames cannot be used.
 * `candidates`: arrays that may hold the positions of objects, where no points are found.
 * @typedef {{ paths: string[], points: FormatPoints | null, cameras: string[], problem: string,
 * candidates: import("../../pkg/index.js").Candidate[] }} Opened
 * @typedef {{ number: number } & ({ opened: Opened }
 *   | { frame: Uint8Array<ArrayBuffer> }
 *   | { points: FormatPoints | null }
 *   | { error: string })} Reply
 */

/** @type {Hdf5File | ZarrFile | undefined} */
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
    if (request.type === "named") return { number, points: file?.named(request.columns) ?? null };
    const frame = file?.frame(request.frame) ?? new Uint8Array();
    return { number, frame: /** @type {Uint8Array<ArrayBuffer>} */ (frame) };
  } catch (error) {
    return { number, error: messageOf(error) };
  }
}

/**
 * @param {ToOpen} request
 * @returns {Promise<Opened>}
 */
async function open({ module, path, place, camera }) {
  await init(place.kind === "hdf5" ? { formats: module } : { zarr: module });
  file = fileOf(place, path, camera);
  const { paths, cameras, problem } = file;
  const found = { paths, cameras, problem, candidates: [] };
  try {
    const points = file.points();
    return { ...found, points, candidates: points ? [] : file.candidates() };
  } catch (error) {
    // A person may know which arrays they are.
    const candidates = file.candidates();
    if (candidates.length === 0) throw error;
    return { ...found, points: null, candidates, problem: messageOf(error) };
  }
}

/**
 * @param {Place} place
 * @param {string} path
 * @param {string} [camera]
 */
function fileOf(place, path, camera) {
  // Only workers have it, and so the types of a page do not.
  const reader = new (Reflect.get(globalThis, "FileReaderSync"))();
  const bytes = (/** @type {Blob} */ blob) => new Uint8Array(reader.readAsArrayBuffer(blob));
  if ("files" in place) {
    const { files } = place;
    const read = (/** @type {number} */ i) => bytes(files[i].blob);
    const paths = files.map(({ path }) => path);
    const sizes = Float64Array.from(files, ({ blob }) => blob.size);
    return ZarrFile.open(read, paths, sizes, path, camera);
  }
  const { kind, blob } = place;
  const read = (/** @type {number} */ start, /** @type {number} */ length) =>
    bytes(blob.slice(start, start + length));
  return kind === "hdf5"
    ? Hdf5File.open(read, blob.size, path, camera)
    : ZarrFile.openArchive(read, blob.size, path, camera);
}
