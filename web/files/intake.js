// @ts-check
/**
 * What dropped files are: containers are opened, everything else is read as what it is taken for.
 */

import { GroundTruthTable, KeypointTable, classify } from "../pkg/index.js";
import { openRecording } from "./containers/npz.js";
import { folderOf, openVideo } from "./containers/video.js";
import { openArchive } from "./containers/zip.js";
import { blobOf, bytesOf, mapBounded, readError } from "./sources.js";
import { count } from "../ui/format.js";
import { splitRuns } from "./runs.js";

/**
 * @typedef {import("./sources.js").Source} Source
 * @typedef {import("../pkg/index.js").Arrays} Arrays
 * @typedef {import("../extraction/extractor.js").OpenEncoder} OpenEncoder
 * @typedef {import("../pkg/index.js").TableOptions} TableOptions
 * @typedef {"ground-truth" | "checkpoint" | "keypoints" | "result"} Slot what of each there is used
 * one
 *
 * A file that is no image.
 * @typedef {object} Entry
 * @property {string} path
 * @property {Source} source
 * @property {Blob} blob the content; empty where it could not be unpacked
 * @property {Slot | "unknown"} role
 * @property {boolean} isGuess whether the role rests on nothing but the usual case
 * @property {boolean} isSaid whether the user said what it is
 * @property {string} reason why it was taken for that
 * @property {TableOptions} options what the user said of its numbers
 * @property {Arrays | null} arrays of a recording, whose points it is
 * @property {"new" | "used" | "spare" | "broken" | "unknown"} state new: not parsed yet
 * @property {boolean} wanted whether it takes the place of another one of its kind once it is
 * parsed
 * @property {[number, number] | undefined} imageSize with which it was parsed
 * @property {GroundTruthTable | OpenEncoder | KeypointTable | import("./saved.js").SavedEvaluation
 * | null} content
 * @property {string} error why it is broken
 * @property {boolean} lacksSize whether it is broken only because the size of the images is not
 * known
 * @property {string[]} notices
 * @property {import("../extraction/extraction.js").Extraction | null} extraction of a checkpoint
 *
 * A file with others in it.
 * @typedef {object} Container
 * @property {string} path
 * @property {string} folder where its files are
 * @property {"archive" | "recording" | "video"} kind
 * @property {string} contents in words
 * @property {string} error why it cannot be used at all
 * @property {string[]} problems what of it cannot be used
 *
 * @typedef {{ images: Source[], entries: Entry[], containers: Container[], runs: Map<string,
 * import("./runs.js").RunFolder> }} Found
 */

const READERS = 8;
/** Enough to tell what a file is. */
const HEAD_BYTES = 4096;
/** Archives around an archive. */
const MAX_DEPTH = 2;
const NOTHING = new Uint8Array();
/** @type {Readonly<Found>} */
const NOTHING_FOUND = { images: [], entries: [], containers: [], runs: new Map() };

/**
 * Says what files are, and what is in those that hold others.
 * @param {Source[]} sources
 * @param {(done: number, total: number) => void} onProgress
 * @param {number} [depth] of archives around them
 * @returns {Promise<Found>}
 */
export async function identify(sources, onProgress, depth = 0) {
  const { runs, rest } = splitRuns(sources);
  /** @type {Found} */
  const found = { images: [], entries: [], containers: [], runs };
  const others = [];
  for (const source of rest) {
    // Images are told by their names: most of the files are images, and none is opened for it.
    if (classify(source.path, NOTHING).role === "image") found.images.push(source);
    else others.push(source);
  }
  let done = sources.length - others.length;
  const parts = await mapBounded(others, READERS, async (source) => {
    const part = await open(source, depth);
    onProgress(++done, sources.length);
    return part;
  });
  for (const { images, entries, containers, runs } of parts) {
    for (const image of images) found.images.push(image);
    found.entries.push(...entries);
    found.containers.push(...containers);
    for (const [name, run] of runs) found.runs.set(name, run);
  }
  return found;
}

/**
 * @param {Source} source
 * @param {number} depth
 * @returns {Promise<Found>}
 */
async function open(source, depth) {
  const { path } = source;
  try {
    const blob = await blobOf(source);
    const unpacked = { path, blob };
    const { role, reason, guess } = classify(path, await bytesOf(unpacked, HEAD_BYTES));
    switch (role) {
      case "archive":
        return await inArchive(unpacked, depth);
      case "recording":
        return await inRecording(unpacked, reason);
      case "video":
        return await inVideo(unpacked);
      case "image":
        return only(entryOf(source, "unknown", reason, false));
      default:
        // What is not used need not be kept unpacked.
        return only(entryOf(role === "unknown" ? source : unpacked, role, reason, guess));
    }
  } catch (error) {
    const entry = entryOf(source, "unknown", "", false);
    return only({ ...entry, state: "broken", error: readError(error, path) });
  }
}

/**
 * @param {Source} archive
 * @param {number} depth
 * @returns {Promise<Found>}
 */
async function inArchive(archive, depth) {
  /** @type {Container} */
  const container = {
    path: archive.path,
    folder: archive.path,
    kind: "archive",
    contents: "",
    error: "",
    problems: [],
  };
  /** @type {Found} */
  let found = { ...NOTHING_FOUND };
  try {
    if (depth > MAX_DEPTH) {
      throw new Error(
        `${archive.path} lies in ${depth} other archives; expected at most ${MAX_DEPTH}: unpack ` +
          "the outer one",
      );
    }
    const { sources, problems } = await openArchive(archive);
    container.contents = count(sources.length, "file");
    container.problems = problems;
    found = await identify(sources, () => {}, depth + 1);
  } catch (error) {
    container.error = readError(error, archive.path);
  }
  return { ...found, containers: [container, ...found.containers] };
}

/**
 * @param {Source} recording
 * @param {string} reason
 * @returns {Promise<Found>}
 */
async function inRecording(recording, reason) {
  /** @type {Container} */
  const container = {
    path: recording.path,
    folder: recording.path,
    kind: "recording",
    contents: "",
    error: "",
    problems: [],
  };
  try {
    const { frames, arrays, error } = await openRecording(recording);
    container.contents = frames.length > 0 ? count(frames.length, "frame") : "no frames";
    if (error) container.problems.push(error);
    const entries = [];
    if (arrays.hasPoints) {
      const points = entryOf(recording, "ground-truth", `points of a recording; ${reason}`, true);
      entries.push({ ...points, arrays });
      container.contents += " and points";
    } else arrays.free();
    return { ...NOTHING_FOUND, images: frames, entries, containers: [container] };
  } catch (error) {
    container.error = readError(error, recording.path);
    return { ...NOTHING_FOUND, containers: [container] };
  }
}

/**
 * @param {Source} video
 * @returns {Promise<Found>}
 */
async function inVideo(video) {
  /** @type {Container} */
  const container = {
    path: video.path,
    folder: folderOf(video.path),
    kind: "video",
    contents: "",
    error: "",
    problems: [],
  };
  try {
    const { frames, contents } = await openVideo(video);
    return { ...NOTHING_FOUND, images: frames, containers: [{ ...container, contents }] };
  } catch (error) {
    return {
      ...NOTHING_FOUND,
      containers: [{ ...container, error: readError(error, video.path) }],
    };
  }
}

/**
 * @param {Entry} entry
 * @returns {Found}
 */
function only(entry) {
  return { ...NOTHING_FOUND, entries: [entry] };
}

/**
 * @param {Source} source
 * @param {Entry["role"]} role
 * @param {string} reason
 * @param {boolean} isGuess
 * @returns {Entry}
 */
function entryOf(source, role, reason, isGuess) {
  return {
    path: source.path,
    source,
    blob: "blob" in source ? source.blob : new Blob(),
    role,
    isGuess,
    isSaid: false,
    reason,
    options: {},
    arrays: null,
    state: "new",
    wanted: false,
    imageSize: undefined,
    content: null,
    error: "",
    lacksSize: false,
    notices: [],
    extraction: null,
  };
}

/**
 * Whether an entry is to be parsed: it is new, or it depends on the size of the images, and that is
 * another one now.
 * @param {Entry} entry
 * @param {[number, number] | undefined} imageSize
 */
export function needsParsing({ role, state, content, imageSize: before }, imageSize) {
  if (state === "new") return true;
  if ((role !== "ground-truth" && role !== "keypoints") || String(before) === String(imageSize))
    return false;
  return content === null || (isTable(content) && content.reading.space.value === "px");
}

/**
 * @param {Entry["content"]} content
 * @returns {content is GroundTruthTable | KeypointTable}
 */
export function isTable(content) {
  return content instanceof GroundTruthTable || content instanceof KeypointTable;
}

/**
 * Parses a table in the role it has.
 * @param {Entry} entry
 * @param {[number, number] | undefined} imageSize of the frames, for positions in pixels
 */
export async function parseTable({ role, arrays, source, path, options }, imageSize) {
  const given = { ...options, imageSize };
  if (arrays) return role === "keypoints" ? arrays.keypoints(given) : arrays.groundTruth(given);
  const bytes = await bytesOf(source);
  return role === "keypoints"
    ? KeypointTable.parse(bytes, path, given)
    : GroundTruthTable.parse(bytes, path, given);
}

/**
 * Whether a table that cannot be read could be, if the size of the images were known.
 * @param {Entry} entry
 */
export async function isReadWithSize(entry) {
  if (entry.role !== "ground-truth" && entry.role !== "keypoints") return false;
  try {
    (await parseTable(entry, [1, 1])).free();
    return true;
  } catch {
    return false;
  }
}
