// @ts-check
/** Recordings that are many files, among dropped ones: data sets of LeRobot, Zarr hierarchies. */

/**
 * @typedef {import("./sources.js").Source} Source
 *
 * The files of a data set of LeRobot (version 3) that its frames come from.
 * @typedef {object} LeRobotVideos
 * @property {"lerobot"} kind
 * @property {string} folder where its videos are
 * @property {Source[]} files all of them
 * @property {Source[]} episodes the tables of its episodes
 *
 * @typedef {object} ZarrHierarchy
 * @property {"zarr"} kind
 * @property {string} folder its root, or the archive that it lies in
 * @property {Source[]} files all of them
 * @property {Blob} [archive] the content of that archive
 *
 * @typedef {LeRobotVideos | ZarrHierarchy} Dataset
 */

const EPISODES = /^(|.*\/)meta\/episodes\/chunk-\d+\/file-\d+\.parquet$/;

/** What describes an array or a group. */
const ZARR = /^(?:(.*)\/)?(?:zarr\.json|\.zarray|\.zgroup)$/;

/**
 * Takes the files of data sets out of `sources`.
 * @param {Source[]} sources
 * @param {{ path: string, blob: Blob }} [archive] that they lie in
 * @returns {{ datasets: Dataset[], rest: Source[] }}
 */
export function splitDatasets(sources, archive) {
  const ofLeRobot = splitLeRobot(sources);
  const ofZarr = splitZarr(ofLeRobot.rest, archive);
  return { datasets: [...ofLeRobot.datasets, ...ofZarr.datasets], rest: ofZarr.rest };
}

/**
 * @param {Source[]} sources
 * @param {{ path: string, blob: Blob }} [archive]
 * @returns {{ datasets: ZarrHierarchy[], rest: Source[] }}
 */
function splitZarr(sources, archive) {
  const folders = new Set(sources.flatMap(({ path }) => ZARR.exec(path)?.[1] ?? []));
  if (folders.size === 0) return { datasets: [], rest: sources };
  // The first of an archive is what is read of it, as in the terminal.
  const roots = archive
    ? [[...folders].reduce((a, b) => (b.length < a.length ? b : a))]
    : [...folders].filter((folder) => !parents(folder).some((parent) => folders.has(parent)));
  /** @type {Map<string, Source[]>} */
  const files = new Map(roots.map((root) => [root, []]));
  const rest = [];
  for (const source of sources) {
    const root = parents(source.path).find((folder) => files.has(folder));
    if (root === undefined) rest.push(source);
    else files.get(root)?.push(source);
  }
  const datasets = [...files].map(([folder, files]) => ({
    kind: /** @type {const} */ ("zarr"),
    folder: archive?.path ?? folder,
    files,
    ...(archive ? { archive: archive.blob } : {}),
  }));
  return { datasets, rest };
}

/**
 * The folders that a path lies in, the outermost first.
 * @param {string} path
 */
function parents(path) {
  const parts = path.split("/");
  return parts.slice(1).map((_, i) => parts.slice(0, i + 1).join("/"));
}

/**
 * The videos of LeRobot's data, with what describes them.
 * @param {Source[]} sources
 * @returns {{ datasets: LeRobotVideos[], rest: Source[] }}
 */
function splitLeRobot(sources) {
  const roots = new Set(sources.flatMap(({ path }) => EPISODES.exec(path)?.[1] ?? []));
  /** @type {LeRobotVideos[]} */
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
      datasets.push({ kind: "lerobot", folder, files, episodes });
    }
    rest = rest.filter((source) => !isOfIt(source));
  }
  return { datasets, rest };
}
