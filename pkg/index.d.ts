/**
 * tracklens in JavaScript: parse tables, extract keypoints from encoded images, score them.
 *
 * All points are (x, y). Space `ndc`: x to the right, y down, -1 and +1 at the outer edges of the image.
 * Keypoints of an encoder are in its latent space (+-1 at the centres of the border cells of its last feature
 * map), which {@link latentToImage} places in the image. Every call that takes user data throws an `Error`
 * whose message says what was wrong, where and what to do; `error.kind` is one of
 * `"input" | "mismatch" | "numeric" | "io" | "cancelled"`; `error.reason` is a {@link Reason} where there is a remedy.
 *
 * Names are camelCase. Documents, which can be saved and are what the terminal writes ({@link Evaluation},
 * {@link RunsReport}), have the names of their JSON, in snake_case.
 *
 * Objects of the classes live in WebAssembly memory: call `free()` when done with large ones.
 */

/**
 * The parts of the package, each a WebAssembly file of its own: `scoring` (tables, frames by path, the metric; all that
 * is not said to be of another part), `space` (the same, also of points in space: once it is loaded it takes the place of
 * `scoring`, whose objects mean nothing to it), `extraction` ({@link Encoder}), `images` ({@link imageToArray}), `formats`
 * ({@link Hdf5File}, {@link readPoints}, {@link mapColumns}), `parquet` ({@link readParquet}, {@link readVideoEpisodes}),
 * `zarr` ({@link ZarrFile}), `onnx` ({@link Detector}), `temporal` ({@link temporalQuality}), `figures` and `comparison`
 * ({@link Comparison}).
 */
export type Part =
  | "scoring"
  | "space"
  | "doctor"
  | "extraction"
  | "images"
  | "formats"
  | "parquet"
  | "zarr"
  | "onnx"
  | "temporal"
  | "figures"
  | "comparison";

/** Where a part comes from, if not from beside this file; e.g. a module compiled by another thread. */
export type PartSource = WebAssembly.Module | BufferSource | URL | string | Response;

/** Loads parts, all of them unless named, each once. Nothing of a part works before; scoring alone is a small download. */
export default function init(parts?: Part[] | Partial<Record<Part, PartSource>>): Promise<void>;

/** Compiles a part without loading it, to post it to workers: there `init({ extraction: module })` starts at once. */
export function compile(part: Part): Promise<WebAssembly.Module>;

/**
 * What a program needs to know of an error (`error.reason`) or a notice to offer a remedy; new types may be added.
 *
 * - `missingImageSize`: positions are in pixels and `imageSize` is not known. Nothing else is wrong with the file: with
 *   {@link TableOptions.imageSize} it can be parsed.
 * - `unknownUnit`: positions are in the unit of a simulator; with {@link TableOptions.space} they can be parsed.
 * - `nonFinite`: a keypoint is missing or not finite in a frame; `new Scoring(…, "exclude-frame")` leaves such frames out.
 * - `missingPoints`: `missing` of `points` positions are missing.
 * - `looksLikePixels`: `coordinates` lie far outside the image; `space: "px"` reads them as pixels.
 * - `looksLikeNdc`: all coordinates read as pixels lie in the first corner; `space: "ndc"` reads them as they are.
 * - `looksLikeFractions`: no coordinate is negative, as in a unit from 0 to 1.
 * - `lostPoints`: `points` of them lie at exactly (0, 0) with the least confidence; {@link MinConfidence} hides them.
 * - `otherNumbers`: no frame has a row, and most have one when this is added to the numbers of the rows ({@link Alignment}).
 * - `inSpace`: points have three coordinates; the part `space` scores them.
 * - `keypointsFromOne`: the keypoints of a table count from 1; `firstKeypoint: 1` reads them.
 * - `assumedAxisOrder`: the file does not say the order of the coordinates; `axisOrder` does.
 * - `detectorSettings`: an ONNX model leaves open what `missing` names, e.g. `normalization`, `unit`; the settings of
 *   {@link Detector} say it.
 */
export type Reason =
  | { type: "missingImageSize" }
  | { type: "unknownUnit" }
  | { type: "nonFinite"; keypoint: number }
  | { type: "missingPoints"; missing: number; points: number }
  | { type: "looksLikePixels"; coordinates: number }
  | { type: "looksLikeNdc" }
  | { type: "looksLikeFractions" }
  | { type: "lostPoints"; points: number }
  | { type: "otherNumbers"; frames: number; sequences: number }
  | { type: "keypointsFromOne" }
  | { type: "inSpace" }
  | { type: "detectorSettings"; missing: string[] }
  | { type: "assumedAxisOrder" };

/** The version of the package. */
export function version(): string;

/** What a file is taken for, with the reason in words. */
export interface Classification {
  /**
   * `recording`: frames and points as arrays, for {@link Arrays}, or what {@link needsFormats} tells; `archive`: for {@link readArchive}; `camera`: for
   * {@link Camera}; `result`: an {@link Evaluation} as JSON.
   */
  role:
    | "image"
    | "ground-truth"
    | "keypoints"
    | "checkpoint"
    | "recording"
    | "archive"
    | "video"
    | "camera"
    | "result"
    | "unknown";
  reason: string;
  /** Whether the content could as well be something else. */
  guess: boolean;
}

/**
 * Guesses a file's role from its path and its first bytes (4 kB are enough).
 * Never throws; what is not recognised is `unknown` with the reason.
 */
export function classify(path: string, head: Uint8Array): Classification;

/** A run of consecutive frames in the order of the object that reports it. */
export interface SequenceRange {
  name: string;
  start: number;
  length: number;
}

/** What a person knows about a table and the file does not say. */
export interface TableOptions {
  /** The unit of the positions; default: `px` for DeepLabCut and COCO, otherwise `ndc`. */
  space?: "ndc" | "px" | "fraction";
  /** Default: `xy`. */
  axisOrder?: "xy" | "yx";
  /** The number of the first frame (and keypoint, with one row a point); default: 0. */
  indexBase?: number;
  /** The number of the first keypoint, with one row a point; default: that of the first frame. */
  firstKeypoint?: number;
  /** The axes that run the other way, as where y points up; default: `none`. */
  flip?: "none" | "x" | "y" | "xy";
  /** Whether positions of exactly (0, 0) mean that the point was not found; default: no. */
  zeroIsMissing?: boolean;
  /** Leaves z out of points with three coordinates, which are otherwise in space, in the unit of the file; default: no. */
  xyOnly?: boolean;
  /** `[width, height]`; needed for positions in pixels, but for COCO files, which have it. */
  imageSize?: [number, number];
}

/** A value, and whether a person said it (in the options), the file says it, or it is a guess. */
export interface Known<T> {
  value: T;
  by: "said" | "file" | "guess";
}

/** What the numbers of a table were taken for. */
export interface Reading {
  /** In words, e.g. `one row a point`, `DeepLabCut`. */
  layout: string;
  space: Known<"ndc" | "px" | "fraction">;
  axisOrder: Known<"xy" | "yx">;
  indexBase: Known<number>;
  /** The number of the first keypoint in a table with one row a point. */
  firstKeypoint: number;
  flip: Known<"none" | "x" | "y" | "xy">;
  zeroIsMissing: Known<boolean>;
  /** `[width, height]` of the images, where the file says them and they are all the same. */
  imageSize?: [number, number];
}

/** A camera: JSON, which `docs/formats.md` of the repository describes. Of the part `space`. */
export class Camera {
  private constructor();
  /** Throws when it is not such JSON, or its numbers are not those of a camera. */
  static parse(bytes: Uint8Array, name: string): Camera;
  /** Width and height of its images. */
  readonly imageSize: [number, number];
  free(): void;
}

/** Ground truth: table `sequence,frame,object,x,y` (tidy CSV, ndc; empty x and y = not visible), or x, y, z in any unit. */
export class GroundTruthTable {
  private constructor();
  /** Throws when the layout is unknown, a field is wrong, or positions are in pixels and no image size is known. */
  static parse(bytes: Uint8Array, name: string, options?: TableOptions): GroundTruthTable;
  /** The positions in the image of a camera, in ndc; throws when they are in an image already. Of the part `space`. */
  projected(camera: Camera): GroundTruthTable;
  readonly name: string;
  readonly objects: string[];
  readonly frames: number;
  readonly sequences: number;
  /** How many coordinates a position has: 2 in the image, 3 in space. */
  readonly axes: number;
  /** Whether positions say how sure they are: `likelihood`, `score`, `confidence`, `visible`, COCO's v. */
  readonly hasConfidence: boolean;
  readonly reading: Reading;
  toObject(): TableObject;
  /** What a person should know of how the table was read, e.g. a semicolon as separator. */
  readonly notices: string[];
  /** The reasons behind those notices that have a remedy. */
  readonly reasons: Reason[];
  free(): void;
}

/** Keypoints over frames: table `sequence,frame,keypoint,x,y`, or what an {@link Encoder} extracted. */
export class KeypointTable {
  private constructor();
  static parse(bytes: Uint8Array, name: string, options?: TableOptions): KeypointTable;
  /**
   * The keypoints of all `frames`, extracted in their order: `points` holds frames x keypoints x 2 numbers, `confidences`
   * frames x keypoints.
   */
  static fromExtraction(
    frames: FrameIndex,
    points: Float64Array,
    keypoints: number,
    confidences?: Float64Array,
  ): KeypointTable;
  readonly name: string;
  readonly keypoints: number;
  readonly frames: number;
  /** How many coordinates a keypoint has: 2 in the image, 3 in space. */
  readonly axes: number;
  /** Whether keypoints say how sure they are. */
  readonly hasConfidence: boolean;
  readonly reading: Reading;
  toObject(): TableObject;
  readonly notices: string[];
  readonly reasons: Reason[];
  /** The table as CSV, as `tracklens extract` writes it. */
  toCsv(): string;
  free(): void;
}

/**
 * The frames among dropped files: images by path, one folder a sequence, in natural order
 * (`frame_2` before `frame_10`). Throws when there is no image among the paths, and when the numbers in the file
 * names of a folder do not tell its frames apart (a copy beside its original).
 */
export class FrameIndex {
  constructor(paths: string[]);
  /** All `paths` are frames, whatever their endings; e.g. those in an NPZ file. */
  static ofAll(paths: string[]): FrameIndex;
  /** The number of frames. */
  readonly length: number;
  readonly sequences: SequenceRange[];
  /** For each frame in order, its position in the `paths` given. */
  readonly order: Uint32Array;
  /**
   * Only the frames at `positions` (ascending, in the order of this index), with the same sequences and frame
   * numbers; `order` still refers to the same paths. For leaving out frames that cannot be decoded.
   */
  select(positions: Uint32Array): FrameIndex;
  /** Paths that are no images. */
  readonly ignored: string[];
  free(): void;
}

/** A file in a ZIP archive. */
export interface ArchiveEntry {
  path: string;
  /** Where its local header begins. */
  offset: number;
  /** Bytes in the archive, and unpacked. */
  packed: number;
  size: number;
  /** By DEFLATE; otherwise stored as it is. */
  deflated: boolean;
  crc32: number;
  /** Why it cannot be unpacked (encrypted, another method, too large or too well packed); otherwise empty. */
  problem: string;
}

/**
 * The directory of a ZIP archive of `size` bytes from its last ones, `tail` (256 kB are enough for most); `needs` is where
 * the directory begins if more are needed. Throws when it is damaged, has more than 200,000 entries, or entries share bytes.
 */
export function readArchive(
  tail: Uint8Array,
  size: number,
  name: string,
): { entries: ArchiveEntry[]; needs: null } | { entries: null; needs: number };

/** The arrays (`.npy`) of an NPZ file. Frames stay where they are; of points all bytes are needed. */
export class Arrays {
  constructor(name: string);
  /** Whether an array of this name holds frames, points or their names; the others are not needed. */
  static uses(array: string): boolean;
  /** How many bytes from the beginning of an array of `size` bytes {@link add} needs. */
  static bytesNeeded(array: string, size: number): number;
  /**
   * Adds an array: its name without `.npy`, its first bytes, and the size of all of it. The only array of a `.npy` file is
   * called `keypoints`.
   */
  add(array: string, bytes: Uint8Array, size: number): void;
  readonly hasFrames: boolean;
  readonly hasPoints: boolean;
  /**
   * Where the frames lie: frame i in order is the `length` bytes of `array` from `start + i * length`. `header` before them
   * makes a `.npy` file, which {@link Encoder.extract} takes. `paths` are for {@link FrameIndex.ofAll}.
   */
  frames(): { array: string; paths: string[]; width: number; height: number; start: number; length: number; header: number[] };
  groundTruth(options?: TableOptions): GroundTruthTable;
  keypoints(options?: TableOptions): KeypointTable;
  free(): void;
}

/** Whether it is the beginning of an HDF5 file or a pickle, which {@link readPoints} has to read. Needs no part. */
export function needsFormats(file: Uint8Array): boolean;

/**
 * Points of a file: a table, CSV, with the unit of its positions where it cannot say it and what a person should know of how it
 * was made, or arrays to {@link Arrays.add}, and whether there are frames beside them.
 */
export type FormatPoints =
  | { table: Uint8Array; space: TableOptions["space"] | null; notices: string[]; arrays: null; hasFrames: false }
  | { table: null; space: null; notices: string[]; arrays: { name: string; bytes: Uint8Array }[]; hasFrames: boolean };

/**
 * The points of an HDF5 file (recordings, SLEAP's analyses and projects, pandas and so DeepLabCut) or a pickle (TAP-Vid, tracks
 * of points). Of SLEAP's projects, pandas and pickles it makes the table that their program would export. Part `formats`.
 */
export function readPoints(file: Uint8Array, name: string): FormatPoints;

/** The table in a Parquet file. Part `parquet`. */
export function readParquet(file: Uint8Array, name: string): FormatPoints;

/** The frames of a video that are one episode. */
export interface VideoEpisode {
  /** The sequence, as {@link readParquet} calls it in the data. */
  sequence: string;
  /** The folder below `videos/`. */
  camera: string;
  /** The video in that folder, without its ending. */
  video: string;
  /** When its first frame is shown, in seconds of the video. */
  start: number;
  /** How many frames it has. */
  frames: number;
}

/** The episodes in the videos of LeRobot's data, as a table below `meta/episodes/` lists them. Part `parquet`. */
export function readVideoEpisodes(file: Uint8Array, name: string): VideoEpisode[];

/** Whether it is the beginning of a Parquet file. Needs no part. */
export function needsParquet(file: Uint8Array): boolean;

/** An array of a recording. */
export interface Candidate {
  name: string;
  shape: number[];
}

/** A recording of any size, of which is read what is asked for. */
export interface RecordingFile {
  /** The cameras that have frames, where there are several. */
  readonly cameras: string[];
  /** The points, as {@link readPoints} gives them; `null` where there are frames and no points. */
  points(): FormatPoints | null;
  /** The arrays that may hold the positions of objects, for {@link RecordingFile.named}; of episodes those of the first. */
  candidates(): Candidate[];
  /**
   * The positions of the objects that `columns` names, each with its array or some numbers of its rows, as
   * `eef=obs/robot0_eef_pos,block=state[2:4]`: a table, in a unit that the file does not say.
   */
  named(columns: string): FormatPoints;
  /** Why the frames cannot be used, with the file's name; empty where they can, and where there are none. */
  readonly problem: string;
  /** The frames, each in the folder of its sequence, for {@link FrameIndex.ofAll}. */
  readonly paths: string[];
  /** A frame as a `.npy` file, which {@link Encoder.extract} takes. */
  frame(i: number): Uint8Array;
  free(): void;
}

/**
 * An HDF5 file of which `read` gives what is asked for; e.g. by `FileReaderSync` in a worker. Part `formats`.
 */
export class Hdf5File {
  private constructor();
  /**
   * Opens a file of `size` bytes; `read` gives the `length` bytes from `start` on. `camera` names the array of frames, where there
   * are several; without it, it is the first.
   */
  static open(read: (start: number, length: number) => Uint8Array, size: number, name: string, camera?: string): Hdf5File;
}
export interface Hdf5File extends RecordingFile {}

/** A Zarr hierarchy, version 2 or 3, of which `read` gives what is asked for. Part `zarr`. */
export class ZarrFile {
  private constructor();
  /**
   * Opens a folder by the `paths` of its files from its root and their `sizes` in bytes; `read` gives the bytes of the file with
   * that number. `camera` as for {@link Hdf5File.open}.
   */
  static open(
    read: (file: number) => Uint8Array,
    paths: string[],
    sizes: Float64Array,
    name: string,
    camera?: string,
  ): ZarrFile;
  /** Opens a ZIP archive, as {@link Hdf5File.open} opens a file. */
  static openArchive(read: (start: number, length: number) => Uint8Array, size: number, name: string, camera?: string): ZarrFile;
}
export interface ZarrFile extends RecordingFile {}

/**
 * A table whose columns have other names, with those that are expected: `columns` stand in the place of `expected`, nothing
 * where all rows have the same sequence or point. Part `formats`.
 */
export function mapColumns(
  table: Uint8Array,
  name: string,
  expected: string[],
  columns: string[],
  isKeypoints: boolean,
): Uint8Array;

/** How frames found their rows. */
export interface JoinReport {
  matched: number;
  /** How sequences and frames were matched, in words. */
  rules: string[];
  /** Frames without a row of ground truth: how many, and the first ones by name. */
  unmatchedFrames: { count: number; first: string[] };
  /** Frames of the ground truth for which there is no image or keypoint: how many, and the first ones. */
  unmatchedRows: { count: number; first: string[] };
  /** All of both, by sequence. */
  unmatched: { frames: UnmatchedSequence[]; rows: UnmatchedSequence[] };
}

/** Frames of a sequence without a partner: how many, and their numbers, e.g. `0–4, 7`. */
export interface UnmatchedSequence {
  sequence: string;
  count: number;
  frames: string;
}

/** What is added to the numbers of the rows before they are matched; default: 0. */
export interface Alignment {
  frames: number;
  /** To the numbers in the names of sequences, which then match by number only. */
  sequences: number;
}

/** Joins frames to the rows of a ground truth without scoring. Throws when nothing matches. */
export function joinFrames(frames: FrameIndex, truth: GroundTruthTable, alignment?: Partial<Alignment>): JoinReport;

/** What would put something right that looks wrong; new types may be added. */
export type Remedy =
  | { type: "unit"; side: "truth" | "keypoints"; space: "ndc" | "px" | "fraction" }
  | { type: "count-from"; side: "truth" | "keypoints"; first: number; first_keypoint?: number }
  | { type: "shift-frames"; by: number }
  | { type: "shift-sequences"; by: number }
  | { type: "axes"; side: "truth" | "keypoints"; order: "xy" | "yx"; flip: "none" | "x" | "y" | "xy" }
  | { type: "zero-is-missing"; side: "truth" | "keypoints" };

/** Something that looks wrong with the data; nothing is changed. */
export interface Finding {
  problem: "unit" | "counting" | "first-rows" | "lag" | "axes" | "zeros" | "still";
  /** In words. */
  text: string;
  /** `before` and `after`: the error on held-out frames as things are, and with the first remedy. */
  evidence: { before?: number; after?: number; count: number; of: number };
  /** The likeliest first; none where nothing can be done about it here. */
  remedies: Remedy[];
}

/**
 * A table as a plain object, for {@link examine} and {@link temporalQuality}: for each frame the position of its sequence among
 * those of `head`, and its number in that sequence.
 */
export type TableObject = {
  readonly head: { readonly sequences: string[] };
  readonly sequence: Uint32Array;
  readonly frame: BigUint64Array;
};

/**
 * What looks wrong with two tables that are joined like this, the worst first. Of the part
 * `doctor`. Evaluations of the terminal have it as `findings`.
 */
export function examine(
  truth: TableObject,
  keypoints: TableObject,
  minConfidence?: MinConfidence,
  alignment?: Partial<Alignment>,
): Finding[];

/** Measures over time, beside the TC, of every object's best keypoint (docs/metrics.md of the repository). */
export interface TemporalQuality {
  /** Folds of the sequences that maps are held out on; 0: none. */
  folds: number;
  /** By object, and of all together where that is not a mean of theirs; `null` where there is nothing to be measured. */
  measures: { measure: string; objects: (number | null)[]; all: number | null }[];
}

/** How good the best keypoints of two tables are over time, as `--temporal` of the terminal. Of the part `temporal`. */
export function temporalQuality(
  truth: TableObject,
  keypoints: TableObject,
  minConfidence?: MinConfidence,
  alignment?: Partial<Alignment>,
  options?: ScoreOptions,
): TemporalQuality;

/** What a checkpoint holds. */
export interface EncoderInfo {
  /** E.g. `basic-vel-std-bg`. */
  architecture: string;
  keypoints: number;
  /** Width and height frames are resized to, or `null`: taken as they are. */
  inputSize: [number, number] | null;
  encoderChannels: number[];
  /** Whether the file holds a {@link Decoder} as well. */
  decoder: boolean;
  /** All sizes, as JSON; for {@link latentToImage}. */
  config: string;
  /** The free-form metadata of the file. */
  metadata: Record<string, string>;
}

/** One frame's keypoints. */
export interface Extraction {
  /** N x 2, latent space. */
  points: Float64Array;
  /** Size of the image. */
  width: number;
  height: number;
  free(): void;
}

/** The softmax of one keypoint's last feature map; the keypoint is the mean position under it. */
export interface HeatMap {
  /** Columns and rows. The centres of the border cells are -1 and +1 of the latent space. */
  readonly width: number;
  readonly height: number;
  /** Row by row from the top; their sum is 1. */
  readonly weights: Float32Array;
  free(): void;
}

/**
 * Places latent points (any number x 2) of the encoder with this {@link EncoderInfo.config} in an image of
 * `width` x `height` (ndc).
 */
export function latentToImage(config: string, points: Float64Array, width: number, height: number): Float64Array;

/**
 * The encoder of a checkpoint (`.safetensors`, PyTorch's `.pth`, burn's `.bpk`; its content says which), on the CPU.
 * Part `extraction`.
 */
export class Encoder {
  constructor(bytes: Uint8Array, name: string);
  readonly info: EncoderInfo;
  /**
   * Decodes a PNG image or a numpy array of a frame (`.npy`) and extracts its keypoints. {@link imageToArray} makes an array
   * of a JPEG or WebP image.
   */
  extract(image: Uint8Array, name: string): Extraction;
  /** Decodes an image and gives the weights behind one of its keypoints. */
  heatMap(image: Uint8Array, name: string, keypoint: number): HeatMap;
  free(): void;
}

/** What a {@link Detector} is, and how it is run. */
export interface DetectorInfo {
  /** How the model is run, in words. */
  architecture: string;
  keypoints: number;
  /** Width and height that images are resized to; `null` where each is taken as it is. */
  inputSize: [number, number] | null;
  /** Of an encoder that tracklens exported, for {@link latentToImage}; `null` for others, whose points are ndc. */
  config: string | null;
  /** The metadata of the model. */
  metadata: Record<string, string>;
}

/** The keypoints of a frame by a {@link Detector}. */
export class Detection {
  private constructor();
  /** N x 2: ndc, or the latent space of an exported encoder. */
  readonly points: Float64Array;
  /** N, in the detector's own unit; undefined where it has none. */
  readonly confidences: Float64Array | undefined;
  readonly width: number;
  readonly height: number;
  free(): void;
}

/**
 * A keypoint detector of any origin as an ONNX model, on the CPU. Part `onnx`.
 *
 * `settings` is JSON that says what the model does not (docs/detectors.md of the repository), or empty. What is still open
 * is in the `reason` of the error: `{ type: "detectorSettings", missing: ["normalization", "unit"] }`.
 */
export class Detector {
  constructor(bytes: Uint8Array, name: string, settings: string);
  readonly info: DetectorInfo;
  /** Takes the same images as {@link Encoder.extract}. */
  extract(image: Uint8Array, name: string): Detection;
  free(): void;
}

/** Bytes of memory that this instance of the part `onnx` holds. It never shrinks. */
export function detectorMemory(): number;

/**
 * Decodes a PNG, JPEG or WebP image to a numpy array (`.npy`, height x width x 3 bytes), which {@link Encoder} takes in place
 * of the image. Part `images`.
 */
export function imageToArray(image: Uint8Array, name: string): Uint8Array;

/** Bytes of memory that this instance of the part `images` holds. It never shrinks. */
export function decodingMemory(): number;

/** Whether it is the beginning of a JPEG or WebP image, which {@link imageToArray} has to decode. Needs no part. */
export function needsDecoding(image: Uint8Array): boolean;

/** The decoder of a checkpoint, which makes an image of keypoints, as it was trained to. Part `extraction`. */
export class Decoder {
  private constructor();
  /** Undefined when the checkpoint holds only an encoder. */
  static open(bytes: Uint8Array, name: string): Decoder | undefined;
  readonly width: number;
  readonly height: number;
  /** The image (width x height pixels of red, green, blue, alpha) that comes of the N x 2 latent points of one frame. */
  reconstruct(points: Float64Array): Uint8Array;
  free(): void;
}

/**
 * Bytes of memory that this instance of the part `extraction` holds: weights, and what its largest frame took. It never
 * shrinks.
 */
export function extractionMemory(): number;

/** How to score. Thresholds belong to the mean squared distance in ndc. */
export interface ScoreOptions {
  /** Default `affine`. */
  transform?: "identity" | "scale-translate" | "affine";
  /** Default: `reference`, and `centred` of keypoints in space. */
  rank?: "reference" | "centred" | null;
  /** By object name; objects left out keep their default (cube 0.015, target 0.015, eef 0.1, others 0.015). */
  thresholds?: Record<string, number>;
  /** Width and height of the images, for errors in pixels. */
  imageSize?: [number, number];
  /** Also fit and score on different sequences, in this many folds. */
  folds?: number;
  /** Also give 95 % intervals, from this many resamples of the sequences; {@link Scoring.bootstrap} does it in steps. */
  bootstrap?: number;
  /** Deals sequences to folds and draws the bootstrap; default 0. */
  seed?: number;
  /** Also give the errors by sequence. */
  sequences?: boolean;
  /** Also give other metrics: regression with PCK, min-cost assignment. */
  context?: boolean;
  /** For {@link Scoring.command} alone: that {@link temporalQuality} measured as well. */
  temporal?: boolean;
  /** Smallest confidences at which the TC is also given; default: where the confidences differ. */
  confidenceLevels?: number[];
}

/** One object of an {@link Evaluation}. Fields are `null` when the object is visible in no frame. */
export interface ObjectEvaluation {
  name: string;
  threshold: number;
  tracked: boolean;
  best_keypoint: number | null;
  /** The keypoint with the second smallest error; absent with one keypoint. */
  second_best?: { keypoint: number; error: number };
  /** The tracking error e: mean over time of the squared distance. */
  error: number | null;
  error_sum: number | null;
  rmse: number | null;
  /** Present when the image size is known. */
  rmse_px?: number | null;
  /** Frames in which the object is visible. */
  frames: number;
  /** Of these, frames in which it lies outside the image. */
  outside: number;
  /** truth = a z + b on column vectors (x, y) or (x, y, z): a row of `a` for each coordinate of the object. */
  map: { a: number[][]; b: number[] } | null;
}

/** What a recording can say about one object. */
export interface Sufficiency {
  name: string;
  /** The mean squared distance of the object from its mean position, ndc. */
  variance: number;
  /** Independent observations that its frames amount to. */
  observations: number;
  /** A bound on the probability that random keypoints pass for tracking. */
  chance: number;
  /** Whether `chance` is at most 0.05. */
  known: boolean;
  /** What would be enough; `null` where it is, or the variance is not above the threshold. */
  needed: { frames: number; sequences: number | null } | null;
}

/** Held-out folds: maps and best keypoints are of the other folds. */
export interface HeldOut {
  folds: number;
  seed: number;
  tc: number;
  /** `keypoints`: the best one on the other folds, by the fold. */
  objects: { name: string; tracked: boolean; error: number | null; keypoints: (number | null)[] }[];
}

/** Percentile bootstrap over sequences. */
export interface Intervals {
  method: string;
  level: number;
  resamples: number;
  seed: number;
  tc: [number, number];
  objects: { name: string; error: [number, number] | null }[];
}

/** Other metrics of the same data; shares in the order of `close`. */
export interface Context {
  /** Distances as shares of the side of the image. */
  close: number[];
  /** Linear regression from all keypoints, with the percentage of correct keypoints (Jakab et al., 2018). */
  regression: { object: string; held_out: boolean; frames: number; error: number | null; pck: number[] | null }[];
  /** Min-cost assignment (Kulkarni et al., 2019). */
  assignment: {
    trajectory: "frame" | "sequence";
    keypoints: number;
    objects: number;
    precision: number[];
    recall: number[];
  }[];
}

/** The result, as `tracklens score --json` prints it; `docs/metrics.md` describes every field. */
export interface Evaluation {
  /** 4 where points are in space. */
  schema: "tracklens/evaluation/3" | "tracklens/evaluation/4";
  version: string;
  /** The command that repeats it. */
  command?: string;
  /** `null`: an object has not enough data to tell tracking from chance; see `sufficiency` and `warnings`. */
  tc: number | null;
  frames: number;
  /** Frames left out because a keypoint was not finite. */
  excluded: number;
  /** For every keypoint, the frames in which it is missing; present where one is. */
  missing?: number[];
  transform: "identity" | "scale-translate" | "affine";
  rank: "reference" | "centred";
  /** How `objects` and `errors` were fitted and scored: on the same frames, as in the authors' code. */
  protocol: "fit-and-score-same-frames";
  objects: ObjectEvaluation[];
  /** Per object, the error of every keypoint. */
  errors: (number | null)[][];
  warnings: string[];
  /** What looked wrong with the data; missing where nothing did, or nobody called `examine`. */
  findings?: Finding[];
  image_size?: [number, number];
  /** How many coordinates points have, where some are in space; errors are then in the unit of the ground truth. */
  dimensions?: { keypoints: number; truth: number };
  /** Positions that a camera put into the image, and those behind it, which count as not visible. */
  camera?: { projected: number; behind: number };
  join?: {
    matched: number;
    rules: string[];
    unmatched_frames: { count: number; first: string[] };
    unmatched_rows: { count: number; first: string[] };
  };
  /** Whether the data were enough to tell tracking from chance, by object. */
  sufficiency?: Sufficiency[];
  /** What was hidden, and the TC by the smallest confidence that counts; where keypoints have one. */
  confidence?: {
    least_keypoints: number | null;
    /** `null`: keypoints have no confidence. */
    hidden_keypoints: number | null;
    least_truth: number | null;
    hidden_truth: number | null;
    /** With other smallest confidences: the share of keypoints that is left, and the errors by object. */
    levels: { least: number; kept: number; tc: number | null; errors: (number | null)[] }[];
  };
  /** Where there are two sequences or more, unless `folds` is 0. */
  held_out?: HeldOut;
  /** With `bootstrap`. */
  intervals?: Intervals;
  /** With `sequences`: of the best keypoints, the worst sequence first. */
  sequences?: {
    object: string;
    keypoint: number;
    errors: { sequence: string; frames: number; error: number; worst_frame: number; worst_error: number }[];
  }[];
  /** With `context`. */
  context?: Context;
  /** Of the terminal with `--temporal`, or what {@link temporalQuality} gave. */
  temporal?: TemporalQuality;
}

/**
 * Reads the JSON of an evaluation, of this schema or `tracklens/evaluation/1`. Throws when it is something else, not
 * complete, or of a newer schema, and says what to do. Of the part `comparison`.
 */
export function parseEvaluation(bytes: Uint8Array, name: string): Evaluation;

/** A sequence that plays in {@link evaluationPage}: its first F frames. */
export interface Film {
  sequence: string;
  /** How many frames the sequence has. */
  length: number;
  /** Width and height of the images, or how they relate. */
  size: [number, number];
  /** The numbers of the frames. */
  frames: number[];
  /** The image of each frame as a data URI; empty where there are no images. */
  images: (string | null)[];
  /** The objects, each with a keypoint, (x, y) in ndc or (x, y, z) in the unit of the ground truth; `null` where it is not visible. */
  tracks: {
    object: string;
    keypoint: number;
    truth: (number[] | null)[];
    /** The keypoint under its fitted map. */
    mapped: (number[] | null)[];
  }[];
}

/**
 * An evaluation as one HTML file with its figures, which runs no script and loads nothing. A film shows at most 120 frames,
 * and images up to 2 MiB in all; the page says how many of its frames are shown.
 */
export function evaluationPage(evaluation: Evaluation, film?: Film | null): string;

/** The measures over time of an evaluation that has them, as a table. */
export function temporalTable(evaluation: Evaluation): Table | null;

/** An evaluation as CSV, one line an object, as `tracklens score --csv` prints it. */
export function evaluationCsv(evaluation: Evaluation): string;

/** An evaluation in three lines for a paper: TC and errors, how they were scored, by what. */
export function evaluationText(evaluation: Evaluation): string;

/** The objects of an evaluation as a LaTeX table (booktabs), with how they were scored in its caption. */
export function evaluationTex(evaluation: Evaluation): string;

/** The error of an object with a keypoint in one sequence. */
export interface SequenceError {
  sequence: string;
  /** The joined frames of the sequence: position of the first one, and their number. */
  start: number;
  length: number;
  /** Frames in which the object is visible. */
  frames: number;
  /** The mean squared distance over these. */
  error: number;
  /** The joined frame with the largest squared distance: its position, its number in the sequence, the distance. */
  worst: number;
  worstFrame: number;
  worstError: number;
}

/** 95 % intervals over the sequences, drawn in steps; in all as with `bootstrap` of {@link ScoreOptions}. */
export class Bootstrap {
  private constructor();
  /** Draws the sequences `resamples` times more. Throws when there are fewer than two. */
  draw(resamples: number): void;
  /** The intervals of what was drawn. */
  intervals(): Intervals;
  free(): void;
}

/** Files as they are named in a command: a table of keypoints, or a checkpoint and frames. */
export interface CommandInputs {
  truth: string;
  keypoints?: string;
  checkpoint?: string;
  frames?: string;
  camera?: string;
  /** Options of reading, word by word, e.g. `["--space", "px"]`. */
  options?: string[];
}

/** Points over the joined frames, T x 2 each, or T x 3 in space; NaN where the object is not visible. */
export interface Series {
  truth: Float64Array;
  /** The keypoint as it is (latent space). */
  keypoint: Float64Array;
  /** The keypoint under the fitted map, as the object. */
  transformed: Float64Array;
}

/** How sure points have to be to count, in the unit of their file; those below are missing. */
export interface MinConfidence {
  keypoints?: number;
  truth?: number;
}

/** Ground truth and keypoints, joined; scoring again with other options costs microseconds. */
export class Scoring {
  /**
   * @param onNonFinite what to do with frames in which a keypoint is missing; default `exclude-point`: they do not
   *   count for that keypoint.
   */
  constructor(
    truth: GroundTruthTable,
    keypoints: KeypointTable,
    onNonFinite?: "exclude-point" | "error" | "exclude-frame",
    minConfidence?: MinConfidence,
    alignment?: Partial<Alignment>,
  );
  readonly join: JoinReport;
  /** The number of joined frames T. */
  readonly frames: number;
  /** The numbers of coordinates of a keypoint and of an object: 2 in the image, 3 in space. */
  readonly axes: Uint32Array;
  readonly objects: string[];
  /** The joined frames by sequence, in order. */
  readonly sequences: SequenceRange[];
  /** For each joined frame its frame number in its sequence. */
  readonly frameNumbers: Float64Array;
  /** For each joined frame the position of its image in `frames`, or -1. */
  imagesFrom(frames: FrameIndex): Int32Array;
  evaluate(options?: ScoreOptions): Evaluation;
  /** The error of `object` with `keypoint` by the sequence, the worst one first; sequences that do not show it are left out. */
  sequenceErrors(object: number, keypoint: number, options?: ScoreOptions): SequenceError[];
  /** The squared distance in every joined frame; NaN where the object is not visible. Their mean is the tracking error. */
  distances(object: number, keypoint: number, options?: ScoreOptions): Float64Array;
  /** The keypoints of a joined frame as they are, N x 2, or N x 3 in space. */
  keypointsAt(frame: number): Float64Array;
  /** The points of object `object` and keypoint `keypoint` under the map of `options`. */
  series(object: number, keypoint: number, options?: ScoreOptions): Series;
  bootstrap(options?: ScoreOptions): Bootstrap;
  /** The command of the terminal that gives the same evaluation. */
  command(inputs: CommandInputs, options?: ScoreOptions): string;
  free(): void;
}

/** Colours (CSS hex) and the height of the text of the figures of an evaluation. */
export interface Theme {
  foreground: string;
  muted: string;
  background: string;
  grid: string;
  good: string;
  bad: string;
  accent: string;
  fontSize: number;
}

/** An SVG document, where its plot lies in it, and the values at the ends of the axes. */
export interface Drawn {
  svg: string;
  width: number;
  height: number;
  /** Left, top, width and height. */
  plot: [number, number, number, number];
  x: [number, number];
  y: [number, number];
}

/**
 * The errors of all keypoints (columns) for all objects (rows) as a heat map; `chosen` are keypoints to outline in place of
 * the best ones, by object, -1 for none. Without a theme figures are dark on white.
 */
export function matrixFigure(evaluation: Evaluation, chosen: Int32Array, theme: Theme | undefined, width: number): Drawn;
/** TC over a common factor of all thresholds, on a logarithmic x axis; `factor` is marked. */
export function capabilityFigure(
  evaluation: Evaluation,
  factor: number | undefined,
  theme: Theme | undefined,
  width: number,
): Drawn;
/** TC over the confidence that keypoints need to count; throws where the evaluation has no such levels. */
export function confidenceFigure(evaluation: Evaluation, theme: Theme | undefined, width: number): Drawn;
/** Errors by sequence on a logarithmic y axis, in the order given; the one at `selected` is marked. */
export function sequencesFigure(
  errors: Float64Array,
  threshold: number,
  selected: number | undefined,
  theme: Theme | undefined,
  width: number,
): Drawn;

/** A line over frames. Figures are of the part `figures`. */
export interface LineSeries {
  /** Where all labels are empty, the figure has no legend. */
  label: string;
  /** CSS hex colour, `#rrggbb`. */
  color: string;
  /** One value a frame; NaN leaves a gap. */
  values: Float64Array;
}

/** A line figure of values over frames, drawn by plotters. */
export interface LineFigure {
  title: string;
  xLabel: string;
  yLabel: string;
  /** Frame number of the first value. */
  start: number;
  series: LineSeries[];
  /** Position (index into the values) of a vertical marker, or `null`. */
  cursor: number | null;
  /** Whether the y axis starts at 0; default `false`. */
  fromZero?: boolean;
  /** CSS hex colours. */
  foreground: string;
  background: string;
  grid: string;
  /** Height of the text in canvas pixels. */
  fontSize: number;
}

/** Where a figure has its axes, in canvas pixels: frames `start` to `end` from `left` to `right`, `low` to `high` upwards. */
export interface PlotArea {
  left: number;
  right: number;
  top: number;
  bottom: number;
  start: number;
  end: number;
  low: number;
  high: number;
}

/** Draws a figure over the whole of a canvas (browser only) and says where its axes are. */
export function drawLines(canvas: HTMLCanvasElement, figure: LineFigure): PlotArea;
/** The same figure as an SVG document. */
export function linesToSvg(figure: LineFigure, width: number, height: number): string;

/** The files of a run folder that `tracklens train`, `tracklens sweep` or `tools/rl` wrote, as far as they are there. */
export interface RunFiles {
  /** `config.json` */
  config?: Uint8Array;
  /** `log.jsonl` */
  log?: Uint8Array;
  /** `summary.json` */
  summary?: Uint8Array;
  /** `error.txt`: why the last attempt of a sweep failed. */
  error?: Uint8Array;
}

/** A run folder among files; its files are positions in the list of paths. */
export interface FoundRun {
  /** The path of the folder; empty for files without one. */
  folder: string;
  config: number | null;
  log: number | null;
  summary: number | null;
  error: number | null;
  /** `checkpoint_best.safetensors` */
  best: number | null;
  /** `checkpoint_final.safetensors` */
  last: number | null;
}

/**
 * Finds run folders: those with `log.jsonl` or `summary.json`, and those that a sweep has not finished, whose names end in
 * `.partial`. `rest` are the positions of the files that belong to no run. Of the part `scoring`.
 */
export function findRuns(paths: string[]): { runs: FoundRun[]; rest: number[] };

/** A cell of a {@link Table}. */
export interface TableCell {
  /** What to sort by; `null` where there is no value. */
  value: string | number | null;
  /** What to show. */
  text: string;
  /** Small print after the text, e.g. an interval. */
  small: string | null;
  /** Lines of small print below the text. */
  details: string[];
  emphasis: "good" | "bad" | null;
}

/** A table as every output shows it. */
export interface Table {
  name:
    | "capability"
    | "only-errors"
    | "errors"
    | "improvement"
    | "runs"
    | "success"
    | "correlation"
    | "encoders"
    | "agents"
    | "published"
    | "claims"
    | "temporal";
  caption: string;
  /** What a reader needs to know, in whole sentences; may be empty. */
  note: string;
  /** A group is text that several rows share. */
  columns: { label: string; isText: boolean; isGroup: boolean }[];
  rows: TableCell[][];
}

/** Runs whose errors can be compared. */
export interface RunDataSet {
  /** Two runs, and why they are not of one data set; `null` for the first. */
  reason: string | null;
  objects: string[];
  /** Whether they are trainings, scored on their validation sequences. */
  trained: boolean;
  /** Settings in which they differ, for `groupBy`. */
  settings: string[];
  /** `incomplete` says why a run does not count. */
  runs: { name: string; architecture: string; seed: number | null; epochs: number; incomplete: string | null }[];
}

/** A run of an agent (`tools/rl`). */
export interface ComparedAgent {
  name: string;
  /** What it sees, e.g. `keypoints+robot`. */
  state: string;
  seesByCheckpoint: boolean;
  seed: number;
  /** Steps up to its last evaluation. */
  steps: number;
  /** Why it does not count. */
  incomplete: string | null;
}

/** How to compare runs. */
export interface CompareOptions {
  /** Position in {@link Comparison.dataSets}; default 0. */
  dataSet?: number;
  /** By object name; objects left out keep their default. */
  thresholds?: Record<string, number>;
  /** What the runs of a group have in common: `settings` (all but the seed; default), `architecture`, `name`, or a setting. */
  groupBy?: string;
  /** Draws of the runs for the intervals; default 2000. */
  resamples?: number;
  /** Seeds the draws; default 0. */
  seed?: number;
}

/** A figure as SVG document. */
export interface Figure {
  /** A name for its file, without the ending. */
  name: string;
  caption: string;
  svg: string;
}

/** One object of a {@link RunGroup}; numbers are `null` without a run in which it is visible. */
export interface RunGroupObject {
  name: string;
  threshold: number;
  /** Runs in which it was visible. */
  count: number;
  /** The share of runs that track it. */
  tc: number | null;
  tc_interval: [number, number] | null;
  mean: number | null;
  variance: number | null;
  /** Minimum, lower quartile, median, upper quartile, maximum. */
  quartiles: [number, number, number, number, number] | null;
  iqm_trimmed: number | null;
  iqm_window: number | null;
  iqm_interval: [number, number] | null;
}

/** One group of a {@link RunsReport}. */
export interface RunGroup {
  name: string;
  /** Complete runs; all numbers are over these. */
  complete: number;
  incomplete: { name: string; seed: number | null; epochs: number; reason: string }[];
  epochs: number;
  input: string | null;
  tc: number | null;
  tc_interval: [number, number] | null;
  objects: RunGroupObject[];
  runs: {
    name: string;
    architecture: string;
    seed: number | null;
    epochs: number;
    tc: number;
    /** In the order of the objects. */
    errors: (number | null)[];
    reconstruction: number | null;
  }[];
}

/** One group of {@link AgentsReport}; numbers are `null` without a complete run. */
export interface AgentGroup {
  name: string;
  /** `null` where it is not the same for all. */
  state: string | null;
  architecture: string | null;
  task: string | null;
  complete: number;
  incomplete: { name: string; seed: number; steps: number; reason: string }[];
  steps: number;
  /** Mean TC of the encoders. */
  tc: number | null;
  /** Interquartile means over the runs, smoothed. */
  curve: { step: number; iqm: number; interval: [number, number] | null }[];
  /** At the end of the curve. */
  success: number | null;
  success_interval: [number, number] | null;
  mean_success: number | null;
  mean_success_interval: [number, number] | null;
  runs: {
    name: string;
    task: string;
    state: string;
    encoder: string | null;
    seed: number;
    tc: number | null;
    steps: number;
    success: number;
    last_success: number;
    mean_success: number;
  }[];
}

/** The numbers of agents. */
export interface AgentsReport {
  /** Standard deviation of the Gaussian that success is smoothed by, in evaluations. */
  smoothing: number;
  groups: AgentGroup[];
  objects: string[];
  thresholds: number[];
  /** The encoders, once for each setting of agents that see by them. */
  encoders: {
    name: string;
    crc32: number;
    setting: string;
    runs: number;
    tc: number | null;
    errors: (number | null)[];
    tracked: boolean[];
    success: number;
    success_interval: [number, number] | null;
  }[];
  /** Rank correlation of tracking (of an object's error, or TC) and success. */
  correlations: {
    setting: string;
    object: string | null;
    encoders: number;
    rho: number | null;
    interval: [number, number] | null;
    pairs: number;
    in_order: number;
  }[];
}

/** The numbers of many runs, as `report.json` of `tracklens report`. */
export interface RunsReport {
  schema: "tracklens/report/1";
  version: string;
  /** What the intervals are. */
  intervals: string;
  groups: RunGroup[];
  /** How probable it is that a run of `group` has a lower error than one of `over`. */
  improvement: { object: string; group: string; over: string; probability: number }[];
  agents?: AgentsReport;
  /** Folders that cannot be read. */
  unread: { name: string; reason: string }[];
  notes: string[];
}

/** CRC-32 of a checkpoint, by which agents know their encoders. Of the part `comparison`. */
export function checkpointCrc32(bytes: Uint8Array): number;

/** Runs side by side: trainings and agents by their folders, and detectors that were scored. Of the part `comparison`. */
export class Comparison {
  constructor();
  /** A run folder. What cannot be read is counted in `unread`, with the reason. */
  addRun(name: string, files: RunFiles): void;
  /** A scored detector; without an architecture it is called what its name begins with (`mine` of `mine_seed3.csv`). */
  addEvaluation(name: string, evaluation: Evaluation, architecture?: string): void;
  /** The checkpoints (best, last) of the training of this name, so that agents find their encoders. */
  addCheckpoints(name: string, best?: number, last?: number): void;
  readonly dataSets: RunDataSet[];
  /** Agents are compared beside any data set. */
  readonly agents: ComparedAgent[];
  readonly unread: { name: string; reason: string }[];
  /** Throws when no run of the data set and no agent is complete. */
  compare(options?: CompareOptions): Compared;
  free(): void;
}

/** What {@link Comparison.compare} gives. */
export class Compared {
  private constructor();
  readonly report: RunsReport;
  /**
   * Capabilities and errors (or, where no group has more than one run, the errors alone), the probabilities of improvement,
   * and the runs; success of agents, tracking beside it, and their runs.
   */
  readonly tables: Table[];
  /**
   * Box plots, stacked capabilities, performance profiles, and curves of what has epochs; success of agents over steps, at
   * the end, and over the tracking of their encoders.
   */
  readonly figures: Figure[];
  /** One self-contained document. */
  toHtml(): string;
  toMarkdown(): string;
  /** A line a run. */
  runsCsv(): string;
  /** A line a group and object. */
  errorsCsv(): string;
  /** A line an agent. */
  agentsCsv(): string;
  /** A line a group of agents and step. */
  successCsv(): string;
  free(): void;
}
