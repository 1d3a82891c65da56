// @ts-check
/** Data sets of LeRobot (version 3) among dropped files. */

/**
 * @typedef {import("./sources.js").Source} Source
 *
 * The files of a data set that its frames come from.
 * @typedef {object} Dataset
 * @property {string} folder where its videos are
 * @property {Source[]} files all of them
 * @property {Source[]} episodes the tables of its episodes
 */

const EPISODES = /^(|.*\/)meta\/episodes\/chunk-\d+\/file-\d+\.parquet$/;

/**
 * Takes the videos of data sets out of `sources`, with what describes them.
 * @param {Source[]} sources
 * @returns {{ datasets: Dataset[], rest: Source[] }}
 */
export function splitDatasets(sources) {
  const roots = new Set(sources.flatMap(({ path }) => EPISODES.exec(path)?.[1] ?? []));
  /** @type {Dataset[]} */
  const datasets = [];
  let rest = sources;
  for (const root of roots) {
    const folder = `${root}videos`;
    const isOfIt = (/** @type {Source} */ { path }) =>
      path.startsWith(`${root}meta/`) || path.startsWith(`${folder}/`);
    const files = rest.filter(isOfIt);
    // Data without videos have images or positions only.
    if (files.some(({ path }) => path.startsWith(`${folder}/`))) {
      const episodes = files.filter(({ path }) => EPISODES.test(path));
      datasets.push({ folder, files, episodes });
    }
    rest = rest.filter((source) => !isOfIt(source));
  }
  return { datasets, rest };
}
