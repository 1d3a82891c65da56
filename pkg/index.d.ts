/**
 * tracklens in JavaScript: parse tables, extract keypoints from encoded images, score them.
 *
 * All points are (x, y). Space `ndc`: x to the right, y down, -1 and +1 at the outer edges of the image.
 * Keypoints of an encoder are in its latent space (+-1 at the centres of the border cells of its last feature
 * map), which {@link latentToImage} places in the image. Every call that takes user data throws an `Error`
 * whose message says what was wrong, where and what to do; `error.kind` is one of
 * `"input" | "mismatch" | "numeric" | "io" | "cancelled"`.
 *
 * Objects of the classes live in WebAssembly memory: call `free()` when done with large ones.
 */

/**
 * The parts of the package, each a WebAssembly file of its own: `scoring` (tables, frames by path, the metric; all that
 * is not said to be of another part), `extraction` ({@link Encoder}) and `figures`.
 */
export type Part = "scoring" | "extraction" | "figures";

/** Where a part comes from, if not from beside this file; e.g. a module compiled by another thread. */
export type PartSource = WebAssembly.Module | BufferSource | URL | string | Response;

/** Loads parts, all of them unless named, each once. Nothing of a part works before; scoring alone is a small download. */
export default function init(parts?: Part[] | Partial<Record<Part, PartSource>>): Promise<void>;

/** Compiles a part without loading it, to post it to workers: there `init({ extraction: module })` starts at once. */
export function compile(part: Part): Promise<WebAssembly.Module>;

/** The version of the package. */
export function version(): string;

/** What a file is taken for, with the reason in words. */
export interface Classification {
  /**
   * `recording`: frames and points as arrays, for {@link Arrays}; `archive`: for {@link readArchive}; `result`: an
   * {@link Evaluation} as JSON.
   */
  role: "image" | "ground-truth" | "keypoints" | "checkpoint" | "recording" | "archive" | "video" | "result" | "unknown";
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
  space?: "ndc" | "px";
  /** Default: `xy`. */
  axisOrder?: "xy" | "yx";
  /** The number of the first frame (and keypoint, with one row a point); default: 0. */
  indexBase?: number;
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
  space: Known<"ndc" | "px">;
  axisOrder: Known<"xy" | "yx">;
  indexBase: Known<number>;
}

/** Ground truth: table `sequence,frame,object,x,y` (tidy CSV, ndc; empty x and y = not visible). */
export class GroundTruthTable {
  private constructor();
  /** Throws when the layout is unknown, a field is wrong, or positions are in pixels and no image size is known. */
  static parse(bytes: Uint8Array, name: string, options?: TableOptions): GroundTruthTable;
  readonly name: string;
  readonly objects: string[];
  readonly frames: number;
  readonly sequences: number;
  readonly reading: Reading;
  /** What a person should know of how the table was read, e.g. a semicolon as separator. */
  readonly notices: string[];
  free(): void;
}

/** Keypoints over frames: table `sequence,frame,keypoint,x,y`, or what an {@link Encoder} extracted. */
export class KeypointTable {
  private constructor();
  static parse(bytes: Uint8Array, name: string, options?: TableOptions): KeypointTable;
  /**
   * The keypoints of all `frames`, extracted in their order: `points` holds frames x keypoints x 2 numbers.
   */
  static fromExtraction(frames: FrameIndex, points: Float64Array, keypoints: number): KeypointTable;
  readonly name: string;
  readonly keypoints: number;
  readonly frames: number;
  readonly reading: Reading;
  readonly notices: string[];
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
  /** Adds an array: its name without `.npy`, its first bytes, and the size of all of it. */
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

/** Joins frames to the rows of a ground truth without scoring. Throws when nothing matches. */
export function joinFrames(frames: FrameIndex, truth: GroundTruthTable): JoinReport;

/** What a checkpoint holds. */
export interface EncoderInfo {
  /** E.g. `basic-vel-std-bg`. */
  architecture: string;
  keypoints: number;
  /** Width and height frames are resized to, or `null`: taken as they are. */
  inputSize: [number, number] | null;
  encoderChannels: number[];
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
  /** Decodes a PNG, JPEG or WebP image, or a numpy array of a frame (`.npy`), and extracts its keypoints. */
  extract(image: Uint8Array, name: string): Extraction;
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
  /** Default `reference`. */
  rank?: "reference" | "centred";
  /** By object name; objects left out keep their default (cube 0.015, target 0.015, eef 0.1, others 0.015). */
  thresholds?: Record<string, number>;
  /** Width and height of the images, for errors in pixels. */
  imageSize?: [number, number];
}

/** One object of an {@link Evaluation}. Fields are `null` when the object is visible in no frame. */
export interface ObjectEvaluation {
  name: string;
  threshold: number;
  tracked: boolean;
  best_keypoint: number | null;
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
  /** truth = a z + b on column vectors (x, y). */
  map: { a: [[number, number], [number, number]]; b: [number, number] } | null;
}

/** The result, as `tracklens score --json` prints it. */
export interface Evaluation {
  schema: "tracklens/evaluation/2";
  version: string;
  tc: number;
  frames: number;
  /** Frames left out because a keypoint was not finite. */
  excluded: number;
  transform: "identity" | "scale-translate" | "affine";
  rank: "reference" | "centred";
  /** How fitting and scoring frames relate; always the same frames for now, as in the authors' code. */
  protocol: "fit-and-score-same-frames";
  objects: ObjectEvaluation[];
  /** Per object, the error of every keypoint. */
  errors: (number | null)[][];
  warnings: string[];
}

/** Points over the joined frames, T x 2 each; NaN where the object is not visible. */
export interface Series {
  truth: Float64Array;
  /** The keypoint as it is (latent space). */
  keypoint: Float64Array;
  /** The keypoint under the fitted map (ndc). */
  transformed: Float64Array;
}

/** Ground truth and keypoints, joined; scoring again with other options costs microseconds. */
export class Scoring {
  /** @param onNonFinite what to do with frames in which a keypoint is not finite; default `error`. */
  constructor(
    truth: GroundTruthTable,
    keypoints: KeypointTable,
    onNonFinite?: "error" | "exclude-frame",
  );
  readonly join: JoinReport;
  /** The number of joined frames T. */
  readonly frames: number;
  readonly objects: string[];
  /** The joined frames by sequence, in order. */
  readonly sequences: SequenceRange[];
  /** For each joined frame its frame number in its sequence. */
  readonly frameNumbers: Float64Array;
  /** For each joined frame the position of its image in `frames`, or -1. */
  imagesFrom(frames: FrameIndex): Int32Array;
  evaluate(options?: ScoreOptions): Evaluation;
  /** The points of object `object` and keypoint `keypoint` under the map of `options`. */
  series(object: number, keypoint: number, options?: ScoreOptions): Series;
  free(): void;
}

/** A line over frames. Figures are of the part `figures`. */
export interface LineSeries {
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
  /** CSS hex colours. */
  foreground: string;
  background: string;
  grid: string;
  /** Height of the text in canvas pixels. */
  fontSize: number;
}

/** Draws a figure over the whole of a canvas (browser only). */
export function drawLines(canvas: HTMLCanvasElement, figure: LineFigure): void;
/** The same figure as an SVG document. */
export function linesToSvg(figure: LineFigure, width: number, height: number): string;

/** The files of a run folder that `tracklens train` or `tracklens sweep` wrote, as far as they are there. */
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

/** The numbers of many runs, as `report.json` of `tracklens report`. */
export interface RunsReport {
  schema: "tracklens/report/1";
  version: string;
  /** What the intervals are. */
  intervals: string;
  groups: RunGroup[];
  /** How probable it is that a run of `group` has a lower error than one of `over`. */
  improvement: { object: string; group: string; over: string; probability: number }[];
  /** Folders that cannot be read. */
  unread: { name: string; reason: string }[];
  notes: string[];
}

/** Runs side by side: trainings by their folders, and detectors that were scored. Of the part `figures`. */
export class Comparison {
  constructor();
  /** A run folder. What cannot be read is counted in `unread`, with the reason. */
  addRun(name: string, files: RunFiles): void;
  /** A scored detector; without an architecture it is called what its name begins with (`mine` of `mine_seed3.csv`). */
  addEvaluation(name: string, evaluation: Evaluation, architecture?: string): void;
  readonly dataSets: RunDataSet[];
  readonly unread: { name: string; reason: string }[];
  /** Throws when no run of the data set is complete. */
  compare(options?: CompareOptions): Compared;
  free(): void;
}

/** What {@link Comparison.compare} gives. */
export class Compared {
  private constructor();
  readonly report: RunsReport;
  /** Box plots, stacked capabilities, performance profiles, and curves of what has epochs. */
  readonly figures: Figure[];
  /** One self-contained document. */
  toHtml(): string;
  toMarkdown(): string;
  /** A line a run. */
  runsCsv(): string;
  /** A line a group and object. */
  errorsCsv(): string;
  free(): void;
}
