// @ts-check
/**
 * Writes ZIP archives. The browser deflates, and its gzip format says the checksum that an archive
 * needs.
 */

/** @typedef {{ path: string, blob: Blob }} File */

/** Before and after the deflated data of a gzip stream without a name (RFC 1952). */
const GZIP = { header: 10, trailer: 8 };
/** Of the format, in the order in which they stand in it. */
const SIGNATURE = { entry: 0x04034b50, listed: 0x02014b50, end: 0x06054b50 };
const VERSION = 20;
/** Names are UTF-8. */
const FLAGS = 0x0800;
const DEFLATED = 8;
/** 1980-01-01, the first day that the format knows: archives of the same files are the same. */
const DATE = 0x21;

/**
 * @param {File[]} files
 * @returns {Promise<Blob>}
 */
export async function zipOf(files) {
  /** @type {BlobPart[]} */
  const parts = [];
  const listed = [];
  let offset = 0;
  for (const { path, blob } of files) {
    const name = new TextEncoder().encode(path);
    const { deflated, checksum } = await deflate(blob);
    const sizes = [checksum, deflated.length, blob.size];
    const common = [...[VERSION, FLAGS, DEFLATED, 0, DATE].map(two), ...sizes.map(four)];
    const lengths = [two(name.length), two(0)];
    const local = joined([four(SIGNATURE.entry), ...common, ...lengths, name]);
    parts.push(local, deflated);
    listed.push(
      joined([
        four(SIGNATURE.listed),
        two(VERSION),
        ...common,
        ...lengths,
        ...[0, 0, 0].map(two),
        four(0),
        four(offset),
        name,
      ]),
    );
    offset += local.length + deflated.length;
  }
  const size = listed.reduce((sum, { length }) => sum + length, 0);
  const counts = [0, 0, files.length, files.length].map(two);
  const end = joined([four(SIGNATURE.end), ...counts, four(size), four(offset), two(0)]);
  return new Blob([...parts, ...listed, end], { type: "application/zip" });
}

/** @param {Blob} blob */
async function deflate(blob) {
  const stream = blob.stream().pipeThrough(new CompressionStream("gzip"));
  const packed = new Uint8Array(await new Response(stream).arrayBuffer());
  const end = packed.length - GZIP.trailer;
  const checksum = new DataView(packed.buffer).getUint32(end, true);
  return { deflated: packed.slice(GZIP.header, end), checksum };
}

/** @param {number} value */
function two(value) {
  return Uint8Array.of(value & 0xff, (value >> 8) & 0xff);
}

/** @param {number} value */
function four(value) {
  return Uint8Array.from([0, 8, 16, 24], (shift) => (value >>> shift) & 0xff);
}

/** @param {Uint8Array[]} parts */
function joined(parts) {
  const all = new Uint8Array(parts.reduce((sum, { length }) => sum + length, 0));
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}
