// @ts-check
/** Folders of runs among dropped files. */

import { findRuns } from "../pkg/index.js";

/**
 * @typedef {import("./sources.js").Source} Source
 *
 * The files of a run that are read, by what they are; its checkpoints only where agents see by them.
 * @typedef {object} RunFolder
 * @property {Source} [config]
 * @property {Source} [log]
 * @property {Source} [summary]
 * @property {Source} [error]
 * @property {Source} [best]
 * @property {Source} [last]
 */

/**
 * Takes the folders of runs out of `sources`.
 * @param {Source[]} sources
 * @returns {{ runs: Map<string, RunFolder>, rest: Source[] }}
 */
export function splitRuns(sources) {
  const found = findRuns(sources.map(({ path }) => path));
  const runs = found.runs.map(({ folder, ...files }) => {
    const present = Object.entries(files).flatMap(([kind, position]) =>
      position === null ? [] : [[kind, sources[position]]],
    );
    // A run's files that are dropped without their folder have no name to go by.
    return /** @type {[string, RunFolder]} */ ([folder || "run", Object.fromEntries(present)]);
  });
  return { runs: new Map(runs), rest: found.rest.map((position) => sources[position]) };
}
