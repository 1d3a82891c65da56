// @ts-check
/**
 * Checkpoints in several `.safetensors` files and an index that says which tensor is where: one file
 * is made of them, whose tensors stay where they lie.
 */

import { baseName } from "../../ui/format.js";
import { blobOf } from "../sources.js";

/**
 * @typedef {import("../sources.js").Source} Source
 *
 * A tensor in the header of a file.
 * @typedef {{ dtype: string, shape: number[], data_offsets: [number, number] }} Tensor
 */

/** Of a header, as the format limits it. */
const MOST_BYTES = 100_000_000;
/** Of the number in front of the header. */
const LENGTH_BYTES = 8;
const METADATA = "__metadata__";

/**
 * The files that an index names, which lie beside it.
 * @param {Source} index
 * @returns {Promise<string[]>} their paths
 */
export async function shardsOf(index) {
  const text = await (await blobOf(index)).text();
  const files = filesOf(text);
  if (!files) {
    throw new Error(
      `${index.path} is not the index of a checkpoint in several files; expected \`weight_map\` ` +
        "with the file of every tensor",
    );
  }
  const folder = index.path.slice(0, index.path.lastIndexOf("/") + 1);
  return files.map((file) => folder + file);
}

/** @param {string} text */
function filesOf(text) {
  try {
    const files = Object.values(JSON.parse(text).weight_map);
    const areNames = files.every((file) => typeof file === "string" && !/[/\\]/.test(file));
    return areNames && files.length > 0 ? [...new Set(files)].sort() : null;
  } catch {
    return null;
  }
}

/**
 * One file of all tensors.
 * @param {string} path of the index
 * @param {Source[]} shards
 * @returns {Promise<Blob>}
 */
export async function joined(path, shards) {
  /** @type {Record<string, unknown>} */
  const header = {};
  /** @type {Record<string, string>} */
  const metadata = {};
  /** @type {BlobPart[]} */
  const parts = [];
  let offset = 0;
  for (const shard of shards) {
    const blob = await blobOf(shard);
    const { tensors, start } = await headerOf(shard.path, blob);
    for (const [name, value] of Object.entries(tensors)) {
      if (name === METADATA) Object.assign(metadata, value);
      else if (name in header) {
        throw new Error(`${path}: \`${name}\` is in two of the files; expected every tensor once`);
      } else {
        const { data_offsets: offsets, ...tensor } = /** @type {Tensor} */ (value);
        header[name] = { ...tensor, data_offsets: offsets.map((at) => at + offset) };
      }
    }
    parts.push(blob.slice(start));
    offset += blob.size - start;
  }
  const text = JSON.stringify({ [METADATA]: metadata, ...header });
  const bytes = new TextEncoder().encode(text);
  const length = new DataView(new ArrayBuffer(LENGTH_BYTES));
  length.setBigUint64(0, BigInt(bytes.length), true);
  return new Blob([length.buffer, bytes, ...parts]);
}

/**
 * What a file says of its tensors, and where the bytes of the first begin.
 * @param {string} path
 * @param {Blob} blob
 * @returns {Promise<{ tensors: Record<string, unknown>, start: number }>}
 */
async function headerOf(path, blob) {
  const damaged = () =>
    new Error(`${baseName(path)} is no whole .safetensors file; is it complete?`);
  const head = await blob.slice(0, LENGTH_BYTES).arrayBuffer();
  if (head.byteLength < LENGTH_BYTES) throw damaged();
  const length = Number(new DataView(head).getBigUint64(0, true));
  const start = LENGTH_BYTES + length;
  if (length > MOST_BYTES || start > blob.size) throw damaged();
  try {
    const tensors = JSON.parse(await blob.slice(LENGTH_BYTES, start).text());
    const areWhole = Object.entries(tensors).every(
      ([name, tensor]) => name === METADATA || Array.isArray(tensor.data_offsets),
    );
    if (areWhole) return { tensors, start };
  } catch {
    // As if it were cut.
  }
  throw damaged();
}
