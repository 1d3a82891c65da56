// @ts-check
/** HDF5 files and pickles: a part of the package reads them that is fetched with the first. */

import init, { Arrays, needsFormats, readPoints } from "../../pkg/index.js";
import { readError } from "../sources.js";

/** @typedef {import("../../pkg/index.js").TableOptions} TableOptions */

const ENDINGS = /\.(h5|hdf5|slp|pkl|pickle)$/i;
/** What is read into memory at most. */
const MOST_BYTES = 2 ** 30;

/**
 * Whether a file is one of them, by its ending or its first bytes.
 * @param {string} path
 * @param {Uint8Array} head
 */
export function isForeign(path, head) {
  return ENDINGS.test(path) || needsFormats(head);
}

/**
 * The points of a file: as a table with the unit of its positions, or as arrays.
 * @param {string} path
 * @param {Blob} file
 * @returns {Promise<{ table: Blob, space: TableOptions["space"] | null }
 *   | { arrays: Arrays, error: string }>} `error` names the frames that are left out
 */
export async function openForeign(path, file) {
  if (file.size > MOST_BYTES) {
    throw new Error(
      `${path} has ${(file.size / 2 ** 30).toFixed(1)} GiB; HDF5 files and pickles are read here ` +
        "up to 1 GiB. In the terminal `tracklens data convert` makes a table or an NPZ file of it",
    );
  }
  await init(["formats"]).catch((error) => {
    throw new Error(
      `${path} needs a part of the page that is not there: ${readError(error, path)}`,
    );
  });
  const found = readPoints(new Uint8Array(await file.arrayBuffer()), path);
  if (found.table) {
    const table = new Blob([/** @type {BlobPart} */ (found.table)], { type: "text/csv" });
    return { table, space: found.space };
  }
  const arrays = new Arrays(path);
  for (const { name, bytes } of found.arrays ?? []) arrays.add(name, bytes, bytes.length);
  const error = found.hasFrames
    ? `${path}: the points are used; the frames of HDF5 files are read in the terminal, where ` +
      "`tracklens data convert` makes an NPZ file of them"
    : "";
  return { arrays, error };
}
