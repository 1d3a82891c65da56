// @ts-check
/** The files in use, as a command in the terminal names them. */

import { tableOf } from "./entry.js";
import { settingsWords } from "./model-settings.js";

/**
 * @typedef {import("./entry.js").Entry} Entry
 * @typedef {import("./library.js").Library} Library
 * @typedef {import("./sources.js").Source} Source
 */

/**
 * @param {Library} library
 * @param {Source[]} frames
 * @returns {import("../pkg/index.js").CommandInputs | null} `null` where no command can say how they
 * are read
 */
export function commandInputs(library, frames) {
  const truth = library.used("ground-truth");
  const table = library.used("keypoints");
  if (truth?.isMapped || table?.isMapped) return null;
  const camera = tableOf(truth)?.axes === 3 ? library.used("camera") : null;
  const isFlat = [truth, table].some((entry) => entry?.options.xyOnly);
  return {
    truth: truth?.path ?? "ground_truth.csv",
    ...(camera ? { camera: camera.path } : {}),
    options: [
      ...readingWords(truth, "--"),
      ...(truth?.columns ? [table ? "--columns" : "--truth-columns", truth.columns] : []),
      ...(isFlat ? ["--xy-only"] : []),
      ...(table ? readingWords(table, "--keypoints-", truth) : []),
      ...(table ? [] : settingsWords(library.used("checkpoint")?.settings ?? {})),
      ...(table?.options.firstKeypoint === undefined
        ? []
        : ["--first-keypoint", String(table.options.firstKeypoint)]),
    ],
    ...(table
      ? { keypoints: table.path }
      : {
          checkpoint: library.used("checkpoint")?.path,
          frames: commonFolder(frames.map(({ path }) => path)),
        }),
  };
}

/**
 * How the user wants a table to be read, as options.
 * @param {Entry | null} entry
 * @param {string} prefix
 * @param {Entry | null} [other] the table whose axis order holds for this one, too, in the terminal
 */
function readingWords(entry, prefix, other) {
  const { space, axisOrder, indexBase, flip, zeroIsMissing, imageSize } = entry?.options ?? {};
  const own = tableOf(entry)?.reading.axisOrder.value;
  const inherited = other?.options.axisOrder;
  const axes = axisOrder ?? (inherited === own ? undefined : inherited && own);
  return [
    ...(space ? [`${prefix}space`, space] : []),
    ...(imageSize ? ["--image-size", imageSize.join("x")] : []),
    ...(axes ? [`${prefix}axis-order`, axes] : []),
    ...(indexBase === undefined ? [] : [`${prefix}index-base`, String(indexBase)]),
    ...(flip ? [`${prefix}flip`, flip] : []),
    ...(zeroIsMissing ? [`${prefix}zero-is-missing`] : []),
  ];
}

/**
 * The folder that all sequences of images lie in.
 * @param {string[]} paths
 */
function commonFolder(paths) {
  if (paths.length === 0) return ".";
  const folders = paths.map((path) => path.split("/").slice(0, -1));
  let depth = 0;
  while (folders.every((folder) => depth < folder.length && folder[depth] === folders[0][depth])) {
    depth++;
  }
  const common = folders[0].slice(0, depth);
  // A single sequence is itself in all paths.
  if (common.length > 0 && folders.every((folder) => folder.length === common.length)) common.pop();
  return common.join("/") || ".";
}
