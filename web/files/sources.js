// @ts-check
/** From what was dropped or picked to files with paths. */

import { messageOf } from "../errors.js";

/**
 * A file with its path from the folder it was dropped in, `/` between the parts; `read` gives one
 * that lies in another file, unpacked.
 * @typedef {{ path: string, blob: Blob } | { path: string, read: () => Promise<Blob> }} Source
 */

/**
 * The content of a file.
 * @param {Source} source
 * @returns {Promise<Blob>}
 */
export async function blobOf(source) {
  return "read" in source ? source.read() : source.blob;
}

/**
 * The bytes of a file; `limit` of them from its beginning.
 * @param {Source} source
 * @param {number} [limit]
 */
export async function bytesOf(source, limit) {
  const blob = await blobOf(source);
  return new Uint8Array(await (limit === undefined ? blob : blob.slice(0, limit)).arrayBuffer());
}

/**
 * The path that the frames of a video lie under: that of the file without its ending, as tables
 * name the sequence.
 * @param {string} path
 */
export function folderOf(path) {
  return path.replace(/\.[^./]*$/, "");
}

/**
 * What kept a file from being read, in words.
 * @param {unknown} error
 * @param {string} path
 */
export function readError(error, path) {
  if (error instanceof DOMException) {
    return `${path} cannot be read: it was changed or removed, or may not be read. Drop it again.`;
  }
  return messageOf(error);
}

/**
 * The files of a drop, folders taken recursively.
 * @param {DataTransfer} transfer
 * @returns {Promise<Source[]>}
 */
export async function fromDrop(transfer) {
  // The items are only readable until the event handler returns: take all handles before the first
  // wait.
  const handles = Array.from(transfer.items, (item) => {
    if (item.kind !== "file") return null;
    return item.webkitGetAsEntry?.() ?? item.getAsFile();
  });
  const sources = await Promise.all(
    handles.map((handle) => {
      if (!handle) return [];
      return handle instanceof File ? [{ path: handle.name, blob: handle }] : fromEntry(handle);
    }),
  );
  return sources.flat();
}

/**
 * The files picked in an input; with `webkitdirectory` their paths start at the folder picked.
 * @param {HTMLInputElement} input
 * @returns {Source[]}
 */
export function fromInput(input) {
  return Array.from(input.files ?? [], (file) => ({
    path: file.webkitRelativePath || file.name,
    blob: file,
  }));
}

/**
 * @param {FileSystemEntry} entry
 * @returns {Promise<Source[]>}
 */
async function fromEntry(entry) {
  if (entry.isFile) {
    const file = await new Promise((resolve, reject) =>
      /** @type {FileSystemFileEntry} */ (entry).file(resolve, reject),
    );
    return [{ path: entry.fullPath.replace(/^\//, ""), blob: file }];
  }
  const reader = /** @type {FileSystemDirectoryEntry} */ (entry).createReader();
  const sources = [];
  for (;;) {
    // A reader hands out a folder in batches and ends with an empty one.
    /** @type {FileSystemEntry[]} */
    const batch = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (batch.length === 0) return sources;
    sources.push(...(await Promise.all(batch.map(fromEntry))).flat());
  }
}

/**
 * Maps `items` with at most `limit` calls under way; results are in the order of the items.
 * @template T, R
 * @param {T[]} items
 * @param {number} limit
 * @param {(item: T, index: number) => Promise<R>} task
 * @returns {Promise<R[]>}
 */
export async function mapBounded(items, limit, task) {
  /** @type {R[]} */
  const results = new Array(items.length);
  let next = 0;
  const lane = async () => {
    while (next < items.length) {
      const index = next++;
      results[index] = await task(items[index], index);
    }
  };
  await Promise.all(Array.from({ length: Math.min(limit, items.length) }, lane));
  return results;
}
