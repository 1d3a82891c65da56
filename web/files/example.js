// @ts-check
/** The example that comes with the page. */

import { mapBounded } from "./sources.js";

/**
 * @typedef {object} Manifest
 * @property {string} title
 * @property {string[]} frames
 * @property {string} truth
 * @property {string} checkpoint
 * @property {string} [note]
 */

const FOLDER = new URL("../example/", import.meta.url);
const CONNECTIONS = 6;

/**
 * Fetches the example.
 * @param {(done: number, total: number) => void} onProgress
 * @returns {Promise<{ manifest: Manifest, sources: import("./sources.js").Source[] }>}
 */
export async function fetchExample(onProgress) {
  /** @type {Manifest} */
  const manifest = await (await get("manifest.json")).json();
  const paths = [manifest.truth, manifest.checkpoint, ...manifest.frames];
  let done = 0;
  const sources = await mapBounded(paths, CONNECTIONS, async (path) => {
    const blob = await (await get(path)).blob();
    onProgress(++done, paths.length);
    return { path, blob };
  });
  return { manifest, sources };
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
