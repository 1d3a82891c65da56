// @ts-check
/** HDF5 files, pickles and Parquet files: parts of the package read them, fetched with the first. */

import init, {
  Arrays,
  needsFormats,
  needsParquet,
  readParquet,
  readPoints,
} from "../../pkg/index.js";
import { readError } from "../sources.js";
import { openSliced } from "./sliced.js";

/**
 * @typedef {import("../sources.js").Source} Source
 * @typedef {import("../../pkg/index.js").FormatPoints} FormatPoints
 * @typedef {import("./npz.js").Recording} Recording
 * @typedef {import("./npz.js").Table} Table
 */

const ENDINGS = /\.(h5|hdf5|slp|pkl|pickle|parquet)$/i;
const HDF5_ENDINGS = /\.(h5|hdf5|slp)$/i;
/** How HDF5 files begin; pickles begin with 0x80. */
const HDF5 = 0x89;
/** What is read into memory at most. */
const MOST_BYTES = 2 ** 30;

/**
 * Whether a file is one of them, by its ending or its first bytes.
 * @param {string} path
 * @param {Uint8Array} head
 */
export function isForeign(path, head) {
  return ENDINGS.test(path) || needsFormats(head) || needsParquet(head);
}

/**
 * The points of a file: as a table with the unit of its positions, or as arrays; and its frames.
 * @param {string} path
 * @param {Blob} file
 * @param {Uint8Array} head its first bytes
 * @param {string} [camera] of several the one whose frames are wanted, instead of the first
 * @returns {Promise<Table | Recording>}
 */
export async function openForeign(path, file, head, camera) {
  const isHdf5 = needsFormats(head) ? head[0] === HDF5 : HDF5_ENDINGS.test(path);
  if (isHdf5) return openRanges(path, file, camera);
  if (file.size > MOST_BYTES) {
    throw new Error(
      `${path} has ${(file.size / 2 ** 30).toFixed(1)} GiB; pickles and Parquet files are read ` +
        "here up to 1 GiB. In the terminal `tracklens data convert` makes a table of it",
    );
  }
  const isParquet = needsParquet(head) || /\.parquet$/i.test(path);
  await load(path, isParquet ? "parquet" : "formats");
  const bytes = new Uint8Array(await file.arrayBuffer());
  const points = isParquet ? readParquet(bytes, path) : readPoints(bytes, path);
  return "table" in points && points.table ? tableOf(points) : recordingOf(path, points);
}

/**
 * @param {string} path
 * @param {Blob} file an HDF5 file
 * @param {string} [camera]
 * @returns {Promise<Table | Recording>}
 */
async function openRanges(path, file, camera) {
  const sliced = await openSliced(path, { kind: "hdf5", blob: file }, camera);
  const { points, frames } = sliced;
  if (points?.table && frames.length === 0) return tableOf(points);
  return slicedRecording(path, sliced);
}

/**
 * @param {string} path
 * @param {Awaited<ReturnType<typeof openSliced>>} sliced
 * @returns {Recording}
 */
export function slicedRecording(
  path,
  { frames, points, cameras, problem, candidates, named, close },
) {
  const read = async (/** @type {string} */ columns) => {
    const points = await named(columns);
    if (!points) throw new Error(`${path} has no such positions`);
    return tableOf(points);
  };
  return {
    ...recordingOf(path, points),
    ...(points?.table ? { table: tableOf(points) } : {}),
    ...(candidates.length > 0 ? { objects: { arrays: candidates, read } } : {}),
    frames,
    cameras,
    close,
    error: problem,
  };
}

/**
 * @param {string} path
 * @param {FormatPoints | null} points
 * @returns {Recording}
 */
function recordingOf(path, points) {
  const arrays = new Arrays(path);
  for (const { name, bytes } of points?.arrays ?? []) arrays.add(name, bytes, bytes.length);
  return { frames: [], arrays, error: "" };
}

/**
 * @param {FormatPoints} points
 * @returns {Table}
 */
function tableOf({ table, space, notices }) {
  const blob = new Blob([/** @type {BlobPart} */ (table)], { type: "text/csv" });
  return { table: blob, space, notices };
}

/**
 * Waits for a part of the package.
 * @param {string} path of the file that needs it
 * @param {import("../../pkg/index.js").Part} part
 */
export async function load(path, part) {
  await init([part]).catch((error) => {
    throw new Error(
      `${path} needs a part of the page that is not there: ${readError(error, path)}`,
    );
  });
}
