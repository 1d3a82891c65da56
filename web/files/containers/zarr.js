// @ts-check
/** Zarr hierarchies: frames stay in their chunks, points become an NPZ file. */

import { blobOf, mapBounded } from "../sources.js";
import { slicedRecording } from "./formats.js";
import { openSliced } from "./sliced.js";
import { zipOf } from "./zip-writer.js";

/**
 * @typedef {import("../datasets.js").ZarrHierarchy} ZarrHierarchy
 * @typedef {import("./npz.js").Recording} Recording
 */

const READERS = 8;

/**
 * @param {ZarrHierarchy} hierarchy
 * @param {string} [camera] of several the one whose frames are wanted, instead of the first
 * @returns {Promise<Recording>}
 */
export async function openZarr({ folder, files, archive }, camera) {
  const within = folder.length + 1;
  const place = archive
    ? { kind: /** @type {const} */ ("zarr"), blob: archive }
    : {
        kind: /** @type {const} */ ("zarr"),
        files: await mapBounded(files, READERS, async (file) => ({
          path: file.path.slice(within),
          blob: await blobOf(file),
        })),
      };
  const sliced = await openSliced(folder, place, camera);
  const members = (sliced.points?.arrays ?? []).map(({ name, bytes }) => ({
    path: `${name}.npy`,
    blob: new Blob([/** @type {BlobPart} */ (bytes)]),
  }));
  return { ...slicedRecording(folder, sliced), kept: await zipOf(members) };
}
