// @ts-check
/** Recordings: frames stay where they lie, points are read. */

import { messageOf } from "../../errors.js";
import { Arrays } from "../../pkg/index.js";
import { blobOf } from "../sources.js";
import { isForeign, openForeign } from "./formats.js";
import { NPY_TYPE, isArray } from "./npy.js";
import { entriesOf, unpack } from "./zip.js";

/**
 * @typedef {import("../sources.js").Source} Source
 * @typedef {import("../../pkg/index.js").TableOptions} TableOptions
 *
 * The frames of a recording, and its arrays, whose points are read from them, or a table of points
 * in their place; `error` says why there are no frames though there is an array of them, `cameras`
 * are all of them, where there are several, `close` gives back what reading frames holds; `kept` is
 * an NPZ file of the points, where they lie in many files; `objects` are arrays of which a person
 * can say that they are objects.
 * @typedef {{ frames: Source[], arrays: Arrays, table?: Table, error: string, cameras?: string[],
 * close?: () => void, kept?: Blob, objects?: Objects }} Recording
 *
 * Arrays that may hold positions, and what reads them as the objects of `columns`, which is as
 * `cube=obs/object[0:3]`.
 * @typedef {{ arrays: import("../../pkg/index.js").Candidate[], read: (columns: string) =>
 * Promise<Table> }} Objects
 *
 * A table that a file was turned into, the unit of its positions where it does not say it, and what
 * is told of how it was made.
 * @typedef {{ table: Blob, space: TableOptions["space"] | null, notices: string[] }} Table
 */

/** Enough to tell what a file is. */
const HEAD_BYTES = 8;

/**
 * @param {Source} recording
 * @param {string} [camera] of several the one whose frames are wanted, instead of the first
 * @returns {Promise<Recording | Table>}
 */
export async function openRecording(recording, camera) {
  const { path } = recording;
  const file = await blobOf(recording);
  const head = new Uint8Array(await file.slice(0, HEAD_BYTES).arrayBuffer());
  if (isForeign(path, head)) return openForeign(path, file, head, camera);
  if (isArray(head)) {
    const arrays = new Arrays(path);
    arrays.add("keypoints", new Uint8Array(await file.arrayBuffer()), file.size);
    return { frames: [], arrays, error: "" };
  }
  return openArchived(path, file);
}

/**
 * The arrays of a recording, read again; `null` where it has become something else.
 * @param {Source} recording
 */
export async function arraysOf(recording) {
  const opened = await openRecording(recording);
  if (!("arrays" in opened)) return null;
  // Its frames are those of the recording that is open already.
  opened.close?.();
  return opened.arrays;
}

/**
 * @param {string} path
 * @param {Blob} file an NPZ file
 * @returns {Promise<Recording>}
 */
async function openArchived(path, file) {
  const arrays = new Arrays(path);
  /** @type {Map<string, Blob>} */
  const blobs = new Map();
  const found = [];
  for (const entry of await entriesOf(file, path)) {
    const name = entry.path.replace(/\.npy$/, "");
    found.push(name);
    if (name === entry.path || !Arrays.uses(name)) continue;
    if (entry.problem) throw new Error(`${path}: the array ${name}: ${entry.problem}`);
    // Frames are read one by one, when they are shown.
    const isWhole = Arrays.bytesNeeded(name, entry.size) === entry.size;
    const blob = await unpack(file, entry, `${path}: the array ${name}`, isWhole);
    blobs.set(name, blob);
    const head = blob.slice(0, Arrays.bytesNeeded(name, blob.size));
    arrays.add(name, new Uint8Array(await head.arrayBuffer()), blob.size);
  }
  if (!arrays.hasFrames && !arrays.hasPoints) {
    arrays.free();
    throw new Error(
      `${path} has no array of frames (\`images\` or \`frames\`) or points (\`keypoints\` or ` +
        `\`sites\`); found ` +
        `${found.map((name) => `\`${name}\``).join(", ") || "nothing"}`,
    );
  }
  if (!arrays.hasFrames) return { frames: [], arrays, error: "" };
  try {
    const { array, paths, start, length, header } = arrays.frames();
    const blob = /** @type {Blob} */ (blobs.get(array));
    const head = new Uint8Array(header);
    const frames = paths.map((frame, i) => ({
      path: `${path}/${frame}`,
      read: async () =>
        new Blob([head, blob.slice(start + i * length, start + (i + 1) * length)], {
          type: NPY_TYPE,
        }),
    }));
    return { frames, arrays, error: "" };
  } catch (error) {
    return { frames: [], arrays, error: messageOf(error) };
  }
}
