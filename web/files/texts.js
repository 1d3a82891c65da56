// @ts-check
/** What is said of files that were dropped. */

import { count, names } from "../ui/format.js";

/**
 * No file of a drop is of use.
 * @param {number} files
 */
export function uselessText(files) {
  const what = files === 1 ? "The file is not" : `None of the ${count(files, "file")} is`;
  return (
    `${what} an image, a table, a checkpoint or a result. Expected PNG, JPEG or WebP images, a ` +
    "recording (.npz), a CSV or JSON table of object positions or keypoints, a checkpoint " +
    "(.safetensors, .pth, .bpk or .onnx), a saved evaluation (.json), or a .zip archive of these."
  );
}

/** @param {string[]} paths that more than one file of a drop had */
export function repeatedText(paths) {
  const listed = names(paths.slice(0, 5), paths.length);
  return (
    `${count(paths.length, "file")} had the same path as another file in the drop: ${listed}. ` +
    "Only the first of each is used. Rename the others, or drop their folders one by one."
  );
}

/** @param {string[]} paths of images that others replaced */
export function replacedText(paths) {
  const listed = names(paths.slice(0, 3), paths.length);
  return (
    `${count(paths.length, "image")} replaced earlier images of the same path: ${listed}. If ` +
    "these are other sequences, rename their folder."
  );
}

/**
 * Several files of a kind of which one is used.
 * @param {string} kind
 * @param {string[]} paths that of the file in use first
 * @param {{ areCompared: boolean, condition: string }} comparison whether they are compared, and
 * when
 */
export function severalText(kind, paths, { areCompared, condition }) {
  const [used] = paths;
  const whole = paths.length === 2 ? "both" : "all of them";
  const use = areCompared
    ? `The results are those of ${used}; ${whole} are compared under “Runs side by side”` +
      `${condition}.`
    : `Only one can be used: ${used} is.`;
  return `There are ${paths.length} ${kind}: ${names(paths)}. ${use}`;
}

/** Frames that have to be marked by hand before they are scored. */
export const LEAST_MARKED = 30;

/**
 * How far a ground truth is that is marked by hand.
 * @param {number} frames
 */
export function markedText(frames) {
  return frames < LEAST_MARKED
    ? `${frames} of at least ${LEAST_MARKED} frames marked`
    : `${count(frames, "frame")} marked`;
}
