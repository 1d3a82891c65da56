// @ts-check
/** Folders of runs among dropped files. */

/**
 * @typedef {import("./sources.js").Source} Source
 *
 * The files of a run that are read, by what they are.
 * @typedef {{ config?: Source, log?: Source, summary?: Source, error?: Source }} RunFolder
 */

/** @type {Record<string, keyof RunFolder>} */
const FILES = {
  "config.json": "config",
  "log.jsonl": "log",
  "summary.json": "summary",
  "error.txt": "error",
};
/** A folder with one of these is a run's. */
const MARKS = ["log.jsonl", "summary.json"];
/** What else a run writes; none of it is looked at. */
const OTHERS =
  /^(state\.safetensors|checkpoint_(best|final)\.safetensors|lock|events\.out\.tfevents\..*)$/;

/**
 * Takes the folders of runs out of `sources`. A folder is one when it holds a log or a summary of
 * training, or, as a sweep leaves it, a configuration or an error in `….partial`; its checkpoints
 * go with it.
 * @param {Source[]} sources
 * @returns {{ runs: Map<string, RunFolder>, rest: Source[] }}
 */
export function splitRuns(sources) {
  const split = (/** @type {string} */ path) => {
    const at = path.lastIndexOf("/");
    return { folder: path.slice(0, Math.max(0, at)), file: path.slice(at + 1) };
  };
  /** @type {Set<string>} */
  const folders = new Set();
  for (const { path } of sources) {
    const { folder, file } = split(path);
    const isPartial = folder.endsWith(".partial") && Object.hasOwn(FILES, file);
    if (MARKS.includes(file) || isPartial) folders.add(folder);
  }
  /** @type {Map<string, RunFolder>} */
  const runs = new Map();
  /** @type {Source[]} */
  const rest = [];
  for (const source of sources) {
    const { folder, file } = split(source.path);
    const isKnown = Object.hasOwn(FILES, file) || OTHERS.test(file);
    if (!folders.has(folder) || !isKnown) {
      rest.push(source);
      continue;
    }
    // A run's files that are dropped without their folder have no name to go by.
    const name = folder || "run";
    const run = runs.get(name) ?? {};
    if (Object.hasOwn(FILES, file)) run[FILES[file]] = source;
    runs.set(name, run);
  }
  return { runs, rest };
}
