// @ts-check
/** The frames that can be marked, and those that are proposed. */

import { KeypointTable } from "../pkg/index.js";

/**
 * @typedef {import("../files/sources.js").Source} Source
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./marks.js").Frame & { source: Source }} MarkedFrame
 */

/** Steps of this share come to no place twice. */
const GOLDEN = 0.618034;

/**
 * The images with the sequence and number that tables name them by.
 * @param {Session} session
 * @returns {MarkedFrame[]}
 */
export function framesOf({ frames, frameSources }) {
  if (!frames) return [];
  // A table over the frames says how the package numbers them.
  const table = KeypointTable.fromExtraction(frames, new Float64Array(2 * frames.length), 1);
  const { head, sequence, frame } = table.toObject();
  table.free();
  return frameSources.map((source, i) => {
    const name = head.sequences[sequence[i]];
    const number = Number(frame[i]);
    return { key: `${number} ${name}`, sequence: name, number, source };
  });
}

/**
 * Frames to be marked, in their order: spread over the sequences, and over each sequence. More of
 * them contain the fewer ones.
 * @param {{ start: number, length: number }[]} sequences
 * @param {number} wanted
 * @returns {number[]} positions
 */
export function proposed(sequences, wanted) {
  const total = sequences.reduce((sum, { length }) => sum + length, 0);
  const order = [...spread(sequences.length, 0)].map((i, rank) => {
    const { start, length } = sequences[i];
    // Of many sequences not all show the middle.
    return { start, positions: spread(length, (GOLDEN * rank) % 1) };
  });
  /** @type {number[]} */
  const found = [];
  while (found.length < Math.min(wanted, total)) {
    for (const { start, positions } of order) {
      const { value, done } = positions.next();
      if (!done && found.length < wanted) found.push(start + value);
    }
  }
  return found.sort((a, b) => a - b);
}

/**
 * The numbers below `n`, each once, so that those before any of them lie spread (van der Corput).
 * @param {number} n
 * @param {number} shift of all of them, as a share of `n`
 * @returns {Generator<number, void>}
 */
function* spread(n, shift) {
  const bits = Math.ceil(Math.log2(n)) + 1;
  /** @type {Set<number>} */
  const seen = new Set();
  for (let i = 1; seen.size < n; i++) {
    let share = 0;
    for (let bit = 0; bit < bits; bit++) share += ((i >> bit) & 1) / 2 ** (bit + 1);
    const at = Math.floor(((share + shift) % 1) * n);
    if (seen.has(at)) continue;
    seen.add(at);
    yield at;
  }
}
