// @ts-check
/** Identifies dropped files: containers are opened, everything else gets the role it is read in. */

import { classify } from "../pkg/index.js";
import { count, names } from "../ui/format.js";
import { openArchive } from "./containers/zip.js";
import { splitDatasets } from "./datasets.js";
import { entryOf } from "./entry.js";
import { parseSettings } from "./model-settings.js";
import { splitRuns } from "./runs.js";
import { blobOf, bytesOf, folderOf, mapBounded, readError } from "./sources.js";

/**
 * @typedef {import("./entry.js").Entry} Entry
 * @typedef {import("./sources.js").Source} Source
 *
 * A file with others in it.
 * @typedef {object} Container
 * @property {string} path
 * @property {string} folder where its files are
 * @property {"archive" | "recording" | "video"} kind
 * @property {string} contents in words
 * @property {string} error why it cannot be used at all; empty once the user has dismissed it
 * @property {string[]} problems what of it cannot be used
 * @property {Cameras} [cameras] where there are several
 * @property {import("./containers/npz.js").Objects} [objects] arrays that may be objects
 * @property {() => void} close gives back what reading from it holds
 *
 * The cameras of a recording, of which one is shown; `open` opens the recording with another.
 * @typedef {{ names: string[], shown: string, open: (name: string) => Promise<Found> }} Cameras
 *
 * @typedef {{ images: Source[], entries: Entry[], containers: Container[], runs: Map<string,
 * import("./runs.js").RunFolder>, settings: Map<string, import("./model-settings.js").Settings> }}
 * Found `settings` by the paths of the models that they are for
 */

const READERS = 8;
/** Enough to tell what a file is. */
const HEAD_BYTES = 4096;
/** Archives around an archive. */
const MAX_DEPTH = 2;
/** Names of files that are meant to be read. */
const NAMED = /\.(csv|tsv|json|safetensors|pth|pt|bpk|onnx|npy|npz|h5|hdf5|slp|pkl|parquet|zip)$/i;
/** What says which tensor of a checkpoint is in which of its files. */
const SHARD_INDEX = /\.safetensors\.index\.json$/i;
/** The settings of a model beside it. */
const SETTINGS = /\.onnx\.json$/i;
const NOTHING = new Uint8Array();
/** @type {Readonly<Found>} */
const NOTHING_FOUND = {
  images: [],
  entries: [],
  containers: [],
  runs: new Map(),
  settings: new Map(),
};

/**
 * Says what files are, and what is in those that hold others.
 * @param {Source[]} sources
 * @param {(done: number, total: number) => void} onProgress
 * @param {number} [depth] of archives around them
 * @param {{ path: string, blob: Blob }} [archive] the one that they lie in
 * @returns {Promise<Found>}
 */
export async function identify(sources, onProgress, depth = 0, archive) {
  const { runs, rest: withoutRuns } = splitRuns(sources);
  const { datasets, rest } = splitDatasets(withoutRuns, archive);
  /** @type {Found} */
  const found = { images: [], entries: [], containers: [], runs, settings: new Map() };
  const others = [];
  for (const source of rest) {
    // Most files are images. Their names identify them, so that none is opened for it.
    if (classify(source.path, NOTHING).role === "image") found.images.push(source);
    else others.push(source);
  }
  let done = found.images.length + (sources.length - withoutRuns.length);
  const { checkpoints, rest: files } = await takeShards(others);
  found.entries.push(...checkpoints);
  const parts = await mapBounded(files, READERS, async (source) => {
    const part = await open(source, depth);
    onProgress(++done, sources.length);
    return part;
  });
  for (const dataset of datasets) {
    parts.push(await (dataset.kind === "zarr" ? inZarr(dataset) : inVideos(dataset)));
    done += dataset.files.length;
    onProgress(done, sources.length);
  }
  for (const { images, entries, containers, runs, settings } of parts) {
    for (const image of images) found.images.push(image);
    found.entries.push(...entries);
    found.containers.push(...containers);
    for (const [name, run] of runs) found.runs.set(name, run);
    for (const [model, said] of settings) found.settings.set(model, said);
  }
  return found;
}

/**
 * Takes checkpoints in several files out of `sources`.
 * @param {Source[]} sources
 * @returns {Promise<{ checkpoints: Entry[], rest: Source[] }>}
 */
async function takeShards(sources) {
  const indices = sources.filter(({ path }) => SHARD_INDEX.test(path));
  if (indices.length === 0) return { checkpoints: [], rest: sources };
  const { joined, shardsOf } = await import("./containers/shards.js");
  const taken = new Set(indices);
  const checkpoints = await mapBounded(indices, READERS, async (index) => {
    const { path } = index;
    try {
      const shards = (await shardsOf(index)).map((file) => {
        const shard = sources.find((source) => source.path === file);
        if (shard) taken.add(shard);
        return { file, shard };
      });
      const missing = shards.filter(({ shard }) => !shard).map(({ file }) => file);
      if (missing.length > 0) {
        throw new Error(
          `${path} names ${names(missing)}, which did not come with it; drop the folder of all of them`,
        );
      }
      const blob = await joined(
        path,
        shards.flatMap(({ shard }) => shard ?? []),
      );
      const reason = `a checkpoint in ${count(shards.length, "file")}, by its index`;
      return entryOf({ path, blob }, { role: "checkpoint", by: "file", reason });
    } catch (error) {
      return brokenEntry(index, error);
    }
  });
  return { checkpoints, rest: sources.filter((source) => !taken.has(source)) };
}

/**
 * @param {Source} source
 * @param {unknown} error
 * @returns {Entry}
 */
function brokenEntry(source, error) {
  const entry = entryOf(source, { role: "unknown", by: "file", reason: "" });
  const parsed = /** @type {const} */ ({ state: "broken", cause: null });
  return { ...entry, parsed: { ...parsed, error: readError(error, source.path) } };
}

/**
 * @param {Source} source
 * @param {number} depth
 * @returns {Promise<Found>}
 */
async function open(source, depth) {
  const { path } = source;
  try {
    const unpacked = { path, blob: await blobOf(source) };
    if (SETTINGS.test(path)) {
      const settings = parseSettings(await unpacked.blob.text(), path);
      return { ...NOTHING_FOUND, settings: new Map([[path.replace(/\.json$/i, ""), settings]]) };
    }
    const head = await bytesOf(unpacked, HEAD_BYTES);
    const { role, reason, guess } = classify(path, head);
    switch (role) {
      case "archive":
        return await inArchive(unpacked, depth);
      case "recording":
        return await inRecording(unpacked, reason);
      case "video":
        return await inVideo(unpacked);
      case "image":
      case "unknown":
        if (NAMED.test(path)) refuseUnreadable(path, head);
        // The content of a file that is not used need not be kept.
        return only(entryOf(source, { role: "unknown", by: "file", reason }));
      default:
        refuseUnreadable(path, head);
        return only(entryOf(unpacked, { role, by: guess ? "guess" : "file", reason }));
    }
  } catch (error) {
    return only(brokenEntry(source, error));
  }
}

/**
 * Rejects a file whose true fault the reader of its format would not name.
 * @param {string} path
 * @param {Uint8Array} head
 */
function refuseUnreadable(path, head) {
  if (head.length === 0) throw new Error(`${path} is empty; expected a file with content`);
  const isUtf16 = (head[0] === 0xff && head[1] === 0xfe) || (head[0] === 0xfe && head[1] === 0xff);
  if (isUtf16) throw new Error(`${path} is text in UTF-16; save it as UTF-8`);
}

/**
 * @param {Container["kind"]} kind
 * @param {string} path
 * @param {string} [folder]
 * @returns {Container}
 */
function containerOf(kind, path, folder = path) {
  return { path, folder, kind, contents: "", error: "", problems: [], close: () => {} };
}

/**
 * @param {{ path: string, blob: Blob }} archive
 * @param {number} depth
 * @returns {Promise<Found>}
 */
async function inArchive(archive, depth) {
  const { path } = archive;
  const container = containerOf("archive", path);
  /** @type {Found} */
  let found = { ...NOTHING_FOUND };
  try {
    if (depth > MAX_DEPTH) {
      throw new Error(
        `${path} is nested in ${depth} other archives; expected at most ${MAX_DEPTH}: unpack ` +
          "the outer one",
      );
    }
    const { sources, problems } = await openArchive(archive);
    container.contents = count(sources.length, "file");
    container.problems = problems;
    if (sources.length === 0 && problems.length > 0) {
      throw new Error(`no file in ${path} can be unpacked: ${problems[0]}`);
    }
    found = await identify(sources, () => {}, depth + 1, archive);
  } catch (error) {
    container.error = readError(error, path);
  }
  // An archive that is a recording is shown as that.
  const isShown = found.containers.some((inner) => inner.path === path);
  return { ...found, containers: isShown ? found.containers : [container, ...found.containers] };
}

/**
 * @param {Source} recording
 * @param {string} reason
 * @returns {Promise<Found>}
 */
function inRecording(recording, reason) {
  return inOpened(recording, reason, async (camera) => {
    const { openRecording } = await import("./containers/npz.js");
    return openRecording(recording, camera);
  });
}

/**
 * @param {import("./datasets.js").ZarrHierarchy} hierarchy
 * @returns {Promise<Found>}
 */
function inZarr(hierarchy) {
  const source = { path: hierarchy.folder, read: async () => new Blob() };
  return inOpened(source, "a Zarr hierarchy, by its files", async (camera) => {
    const { openZarr } = await import("./containers/zarr.js");
    return openZarr(hierarchy, camera);
  });
}

/**
 * @param {Source} recording
 * @param {string} reason
 * @param {(camera?: string) => Promise<import("./containers/npz.js").Recording |
 * import("./containers/npz.js").Table>} open
 * @param {string} [camera] of several the one whose frames are wanted, instead of the first
 * @returns {Promise<Found>}
 */
async function inOpened(recording, reason, open, camera) {
  const { path } = recording;
  const container = containerOf("recording", path);
  const taken = /** @type {const} */ ({ role: "ground-truth", by: "guess" });
  try {
    const opened = await open(camera);
    if (!("arrays" in opened)) return only(tableEntry(path, opened, { ...taken, reason }));
    const { frames, arrays, table, error, cameras, close, kept, objects } = opened;
    if (close) container.close = close;
    container.contents = frames.length > 0 ? count(frames.length, "frame") : "no frames";
    container.cameras = camerasOf(cameras ?? [], camera, (name) =>
      inOpened(recording, reason, open, name),
    );
    container.objects = objects;
    if (error) container.problems.push(error);
    const entries = [];
    if (table) {
      entries.push(tableEntry(path, table, { ...taken, reason }));
      container.contents += " and points";
      arrays.free();
    } else if (arrays.hasPoints) {
      const grounds = `points of a recording; ${reason}`;
      const source = kept ? { path, blob: kept } : recording;
      entries.push(entryOf(source, { ...taken, reason: grounds }, arrays));
      container.contents += " and points";
    } else arrays.free();
    return { ...NOTHING_FOUND, images: frames, entries, containers: [container] };
  } catch (error) {
    container.error = readError(error, path);
    return { ...NOTHING_FOUND, containers: [container] };
  }
}

/**
 * @param {string[]} names
 * @param {string | undefined} chosen
 * @param {Cameras["open"]} open
 * @returns {Cameras | undefined}
 */
function camerasOf(names, chosen, open) {
  return names.length > 1 ? { names, shown: chosen ?? names[0], open } : undefined;
}

/**
 * The objects that a person named in a recording.
 * @param {Container} container
 * @param {string} columns
 * @param {import("./entry.js").Entry["options"]} options
 * @returns {Promise<Entry | null>}
 */
export async function namedObjects({ path, objects }, columns, options) {
  const table = await objects?.read(columns);
  if (!table) return null;
  const taken = /** @type {const} */ ({ role: "ground-truth", by: "said", reason: "" });
  const entry = tableEntry(path, table, taken);
  return {
    ...entry,
    taken: { ...taken, reason: "its arrays as you said" },
    options,
    columns,
    wanted: true,
  };
}

/**
 * A file that was turned into a table, which is what is read and kept of it.
 * @param {string} path
 * @param {import("./containers/npz.js").Table} table
 * @param {import("./entry.js").Taken} taken
 * @returns {Entry}
 */
function tableEntry(path, { table, space, notices }, { role, by, reason }) {
  const grounds = `${reason}; a guess: keypoints can look the same`;
  const entry = entryOf({ path: `${path}.csv`, blob: table }, { role, by, reason: grounds });
  return { ...entry, path, told: notices, options: space ? { space } : {} };
}

/**
 * @param {Source} video
 * @returns {Promise<Found>}
 */
async function inVideo(video) {
  const container = containerOf("video", video.path, folderOf(video.path));
  try {
    const { openVideo } = await import("./containers/video.js");
    const { frames, codec, close } = await openVideo(video);
    Object.assign(container, { contents: `${count(frames.length, "frame")}, ${codec}`, close });
    return { ...NOTHING_FOUND, images: frames, containers: [container] };
  } catch (error) {
    container.error = readError(error, video.path);
    return { ...NOTHING_FOUND, containers: [container] };
  }
}

/**
 * @param {import("./datasets.js").LeRobotVideos} dataset
 * @param {string} [camera] of several the one whose frames are wanted, instead of the first
 * @returns {Promise<Found>}
 */
async function inVideos(dataset, camera) {
  const container = containerOf("video", dataset.folder);
  try {
    const { openDataset } = await import("./containers/lerobot.js");
    const { frames, cameras, contents, problems, close } = await openDataset(dataset, camera);
    Object.assign(container, { contents, problems, close });
    container.cameras = camerasOf(cameras, camera, (name) => inVideos(dataset, name));
    return { ...NOTHING_FOUND, images: frames, containers: [container] };
  } catch (error) {
    container.error = readError(error, dataset.folder);
    return { ...NOTHING_FOUND, containers: [container] };
  }
}

/**
 * @param {Entry} entry
 * @returns {Found}
 */
function only(entry) {
  return { ...NOTHING_FOUND, entries: [entry] };
}
