// @ts-check
/** A file that is not an image: what it was taken for, and what was read from it. */

/**
 * @typedef {import("./sources.js").Source} Source
 * @typedef {import("./saved.js").SavedEvaluation} SavedEvaluation
 * @typedef {import("../errors.js").Reason} Reason
 * @typedef {import("../extraction/extraction.js").Extraction} Extraction
 * @typedef {import("../extraction/extractor.js").OpenEncoder} OpenEncoder
 * @typedef {import("../pkg/index.js").Arrays} Arrays
 * @typedef {import("../pkg/index.js").Camera} Camera
 * @typedef {import("../pkg/index.js").GroundTruthTable} GroundTruthTable
 * @typedef {import("../pkg/index.js").KeypointTable} KeypointTable
 * @typedef {import("../pkg/index.js").TableOptions} TableOptions
 *
 * What a file can be used as. One file is used as each.
 * @typedef {"ground-truth" | "checkpoint" | "keypoints" | "camera" | "result"} Slot
 *
 * What a file was taken for: by its content (`file`), as the usual case (`guess`), or as the user
 * chose (`said`); `reason` gives the grounds in words.
 * @typedef {{ role: Slot | "unknown", by: "file" | "guess" | "said", reason: string }} Taken
 *
 * What was read.
 * @typedef {{ kind: "ground-truth", table: GroundTruthTable }
 *   | { kind: "keypoints", table: KeypointTable }
 *   | { kind: "camera", camera: Camera }
 *   | { kind: "checkpoint", encoder: OpenEncoder, extraction: Extraction }
 *   | { kind: "result", saved: SavedEvaluation }} Content
 *
 * How far reading a file got. `imageSize` is the size it was read with; `error` is empty once the
 * user has dismissed it.
 * @typedef {{ state: "new" }
 *   | { state: "unknown" }
 *   | { state: "broken", error: string, cause: Reason | null, imageSize?: [number, number] }
 *   | { state: "used" | "spare", content: Content, imageSize?: [number, number] }} Parsed
 *
 * @typedef {object} Entry
 * @property {string} path
 * @property {Source} source
 * @property {Arrays | null} arrays of a recording, whose points the entry stands for
 * @property {Taken} taken
 * @property {TableOptions} options how the user wants a table to be read
 * @property {import("./model-settings.js").Settings} settings what is said of an ONNX model
 * @property {string[]} told of how the file became a table, where it was something else
 * @property {boolean} isMapped whether its columns were renamed, which no command repeats
 * @property {string} columns which arrays of a recording are which objects, where the user said it
 * @property {Partial<import("../pkg/index.js").Alignment>} alignment of a ground truth: what is
 * added to its numbers
 * @property {number | null} marked how many frames of it are marked by hand so far, where it is made
 * here
 * @property {boolean} wanted whether it is to be used once it is parsed
 * @property {Parsed} parsed
 */

/**
 * A file that was not parsed yet.
 * @param {Source} source
 * @param {Taken} taken
 * @param {Arrays | null} [arrays]
 * @returns {Entry}
 */
export function entryOf(source, taken, arrays = null) {
  const { path } = source;
  const parsed = /** @type {const} */ ({ state: "new" });
  return {
    path,
    source,
    arrays,
    taken,
    options: {},
    settings: {},
    told: [],
    isMapped: false,
    columns: "",
    alignment: {},
    marked: null,
    wanted: false,
    parsed,
  };
}

/**
 * What was read from a file; `null` when it was not parsed or cannot be used.
 * @param {Entry | null} entry
 * @returns {Content | null}
 */
export function contentOf(entry) {
  return entry && "content" in entry.parsed ? entry.parsed.content : null;
}

/**
 * The table in a file, when it is one.
 * @param {Entry | null} entry
 * @returns {GroundTruthTable | KeypointTable | null}
 */
export function tableOf(entry) {
  const content = contentOf(entry);
  return content && "table" in content ? content.table : null;
}

/**
 * The extraction with the checkpoint in a file, when it is one.
 * @param {Entry | null} entry
 * @returns {Extraction | null}
 */
export function extractionOf(entry) {
  const content = contentOf(entry);
  return content?.kind === "checkpoint" ? content.extraction : null;
}

/**
 * The evaluation in a file, when it is one.
 * @param {Entry | null} entry
 * @returns {SavedEvaluation | null}
 */
export function savedOf(entry) {
  const content = contentOf(entry);
  return content?.kind === "result" ? content.saved : null;
}

/**
 * The camera in a file, when it is one.
 * @param {Entry | null} entry
 * @returns {Camera | null}
 */
export function cameraOf(entry) {
  const content = contentOf(entry);
  return content?.kind === "camera" ? content.camera : null;
}

/** @param {Entry} entry */
export function isTableRole({ taken: { role } }) {
  return role === "ground-truth" || role === "keypoints";
}

/**
 * Whether a file may be a table that only has other names.
 * @param {Entry} entry
 */
export function hasOtherColumns({ path, arrays, parsed, taken: { role } }) {
  if (arrays || !/\.(csv|tsv|txt)$/i.test(path)) return false;
  return parsed.state === "broken" || (parsed.state === "unknown" && role === "unknown");
}

/**
 * Forgets what was read from a file and gives back what that holds in the package. The file itself
 * stays.
 * @param {Entry} entry
 */
export function unread(entry) {
  const content = contentOf(entry);
  if (content?.kind === "checkpoint") {
    content.extraction.stop("idle");
    content.encoder.free();
  } else if (content && "table" in content) content.table.free();
  else if (content?.kind === "camera") content.camera.free();
  entry.parsed = { state: "new" };
}
