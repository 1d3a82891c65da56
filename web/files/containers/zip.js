// @ts-check
/** ZIP archives, read where they lie: an entry is unpacked when it is asked for, and not kept. */

import { readArchive } from "../../pkg/index.js";
import { blobOf } from "../sources.js";

/**
 * @typedef {import("../sources.js").Source} Source
 * @typedef {import("../../pkg/index.js").ArchiveEntry} ArchiveEntry
 */

const LOCAL_HEADER = 30;
/** Bytes for the name and the extra field of most local headers. */
const NAMES = 512;
/** An entry of so many bytes, packed and unpacked together, is read at once. */
const SMALL = 16 * 1024 * 1024;
const LOCAL_MAGIC = 0x04034b50;

/**
 * The files in an archive; those that cannot be unpacked are told.
 * @param {Source} archive
 * @returns {Promise<{ sources: Source[], problems: string[] }>}
 */
export async function openArchive(archive) {
  const blob = await blobOf(archive);
  const sources = [];
  const problems = [];
  for (const entry of await entriesOf(blob, archive.path)) {
    const path = `${archive.path}/${entry.path}`;
    if (entry.problem) problems.push(`${path}: ${entry.problem}`);
    else sources.push({ path, read: () => unpack(blob, entry, path) });
  }
  return { sources, problems };
}

/**
 * The directory of an archive.
 * @param {Blob} blob
 * @param {string} path
 * @returns {Promise<ArchiveEntry[]>}
 */
export async function entriesOf(blob, path) {
  // Without any bytes the answer is how many of the last ones hold the directory of most archives.
  let start = blob.size;
  for (;;) {
    const tail = new Uint8Array(await blob.slice(start).arrayBuffer());
    const { entries, needs } = readArchive(tail, blob.size, path);
    if (entries) return entries;
    start = needs ?? 0;
  }
}

/**
 * The content of an entry, whose size and checksum are compared. A small one is read at once, with
 * its header; of a large one, what is stored as it is stays where it is, and what is packed goes
 * through a stream into a blob, which the browser may hold on disk.
 * @param {Blob} blob the archive
 * @param {ArchiveEntry} entry
 * @param {string} path for messages
 * @param {boolean} [isVerified] whether an entry that is stored as it is is read for its checksum
 * @returns {Promise<Blob>}
 */
export async function unpack(blob, entry, path, isVerified = true) {
  const isSmall = entry.packed + entry.size <= SMALL;
  const ahead = LOCAL_HEADER + (isSmall ? NAMES + entry.packed : 0);
  const read = await blob.slice(entry.offset, entry.offset + ahead).arrayBuffer();
  const header = new DataView(read);
  if (read.byteLength < LOCAL_HEADER || header.getUint32(0, true) !== LOCAL_MAGIC)
    throw damaged(path, "no local header");
  // Name and extra field stand here again, and need not be as long as in the directory.
  const start = LOCAL_HEADER + header.getUint16(26, true) + header.getUint16(28, true);
  const end = start + entry.packed;
  const isRead = isSmall && end <= read.byteLength;
  const inPlace = () => blob.slice(entry.offset + start, entry.offset + end);
  if (entry.offset + end > blob.size) throw damaged(path, "the archive ends before it does");
  if (!entry.deflated && !isVerified) return inPlace();
  const whole = new Meter(entry, path);
  const bytes = isRead
    ? /** @type {ReadableStream} */ (new Response(new Uint8Array(read, start, entry.packed)).body)
    : inPlace().stream();
  const inflated = entry.deflated
    ? bytes.pipeThrough(new DecompressionStream("deflate-raw"))
    : bytes;
  const unpacked = inflated.pipeThrough(whole.stream);
  try {
    if (!entry.deflated) {
      await unpacked.pipeTo(new WritableStream());
      return inPlace();
    }
    const response = new Response(unpacked);
    return isSmall ? new Blob([await response.arrayBuffer()]) : await response.blob();
  } catch (error) {
    throw (
      whole.error ??
      (error instanceof DOMException ? error : damaged(path, "its packed bytes are not whole"))
    );
  }
}

/** Lets bytes through that have the size and the checksum of an entry, and no more. */
class Meter {
  /** @type {Error | null} */
  error = null;
  stream;

  /**
   * @param {ArchiveEntry} entry
   * @param {string} path
   */
  constructor(entry, path) {
    let size = 0;
    let crc = -1;
    /** @param {TransformStreamDefaultController} controller */
    const fail = (controller, /** @type {string} */ reason) => {
      this.error = damaged(path, reason);
      controller.error(this.error);
    };
    this.stream = new TransformStream({
      transform(/** @type {Uint8Array} */ chunk, controller) {
        size += chunk.length;
        if (size > entry.size)
          fail(controller, `it unpacks to more than the ${entry.size} bytes that the archive says`);
        crc = crc32(crc, chunk);
        controller.enqueue(chunk);
      },
      flush(controller) {
        if (size !== entry.size) fail(controller, `it unpacks to ${size} bytes, not ${entry.size}`);
        else if (~crc >>> 0 !== entry.crc32) fail(controller, "its checksum is wrong");
      },
    });
  }
}

/**
 * @param {string} path
 * @param {string} reason
 */
function damaged(path, reason) {
  return new Error(
    `${path} cannot be unpacked: ${reason}. Is the archive complete? Make it again.`,
  );
}

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let crc = byte;
  for (let bit = 0; bit < 8; bit++) crc = crc & 1 ? (crc >>> 1) ^ 0xedb88320 : crc >>> 1;
  return crc;
});

/**
 * The checksum of ZIP over more bytes, not yet inverted.
 * @param {number} crc
 * @param {Uint8Array} bytes
 */
function crc32(crc, bytes) {
  for (let i = 0; i < bytes.length; i++) crc = CRC_TABLE[(crc ^ bytes[i]) & 255] ^ (crc >>> 8);
  return crc;
}
