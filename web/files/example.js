// @ts-check
/** The example that comes with the page. */

import { entriesOf, unpack } from "./containers/zip.js";
import { mapBounded } from "./sources.js";

/**
 * @typedef {object} Manifest
 * @property {string} title
 * @property {string} frames an archive of them, which the site has in the place of their folder
 * @property {string} truth
 * @property {string} checkpoint
 * @property {string} [note]
 */

const FOLDER = new URL("../example/", import.meta.url);
const AT_A_TIME = 32;

/**
 * Fetches the example.
 * @param {(done: number, total: number) => void} onProgress
 * @returns {Promise<{ manifest: Manifest, sources: import("./sources.js").Source[] }>}
 */
export async function fetchExample(onProgress) {
  /** @type {Manifest} */
  const manifest = await (await get("manifest.json")).json();
  const paths = [manifest.truth, manifest.checkpoint, manifest.frames];
  let done = 0;
  const [truth, checkpoint, archive] = await Promise.all(
    paths.map(async (path) => {
      const blob = await (await get(path)).blob();
      onProgress(++done, paths.length);
      return { path, blob };
    }),
  );
  return { manifest, sources: [truth, checkpoint, ...(await framesIn(archive))] };
}

/**
 * The frames in an archive, under the paths that they have in their folder.
 * @param {{ path: string, blob: Blob }} archive
 */
async function framesIn({ path, blob }) {
  const folder = path.replace(/\.zip$/, "");
  return mapBounded(await entriesOf(blob, path), AT_A_TIME, async (entry) => ({
    path: `${folder}/${entry.path}`,
    blob: await unpack(blob, entry, entry.path, false),
  }));
}

/** @param {string} path */
async function get(path) {
  const response = await fetch(new URL(path, FOLDER)).catch(() => null);
  if (!response?.ok) {
    const reason = response ? `status ${response.status}` : "no connection";
    throw new Error(
      `The example's file ${path} could not be fetched (${reason}). ` +
        "Try again when the server can be reached; your own files work without it.",
    );
  }
  return response;
}
