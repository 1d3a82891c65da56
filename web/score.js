// @ts-check
/**
 * A score: joined points, how they are scored, what comes out, and what of it is on display. A
 * session fills it from files. The views listen to its events: `scoring` (another set of joined
 * points), `evaluation` (other options for the same points), `intervals`, `selection` and `choice`
 * (a keypoint other than the best one).
 */

import { latentToImage } from "./pkg/index.js";
import { messageOf } from "./errors.js";
import { load, store } from "./settings.js";

/**
 * @typedef {import("./extraction/extractor.js").OpenEncoder} OpenEncoder
 * @typedef {import("./files/sources.js").Source} Source
 * @typedef {import("./files/saved.js").SavedEvaluation} SavedEvaluation
 * @typedef {import("./pkg/index.js").CommandInputs} CommandInputs
 * @typedef {import("./pkg/index.js").Evaluation} Evaluation
 * @typedef {import("./pkg/index.js").Intervals} Intervals
 * @typedef {import("./pkg/index.js").ScoreOptions} ScoreOptions
 * @typedef {import("./pkg/index.js").Scoring} Scoring
 * @typedef {import("./pkg/index.js").SequenceRange} SequenceRange
 * @typedef {import("./pkg/index.js").Series & { distances: Float64Array }} Series
 *
 * Joined points and what they belong to.
 * @typedef {object} Points
 * @property {Scoring} scoring
 * @property {(Source | null)[]} pictures for each joined frame its image; empty: there are none
 * @property {[number, number][]} sizes width and height by joined frame, or one for all; empty: not
 * known
 * @property {OpenEncoder | null} encoder whose latent space the keypoints are in
 * @property {CommandInputs} inputs the files, as a command names them
 *
 * How points are scored. `thresholds` holds those that were edited, by object.
 * @typedef {{ transform: Evaluation["transform"], rank: Evaluation["rank"], thresholds: Map<string,
 * number> }} Options
 *
 * An evaluation that was read from a file.
 * @typedef {{ path: string, evaluation: SavedEvaluation }} Saved
 */

/** Resamples that the intervals are taken from. */
const RESAMPLES = 1000;
/** Milliseconds that a step of resampling may take, so that the page stays responsive. */
const STEP_MS = 24;

const TRANSFORMS = ["identity", "scale-translate", "affine"];
const RANKS = ["reference", "centred"];
const DEFAULTS = /** @type {const} */ ({ transform: "affine", rank: "reference" });
/** Series of this many pairs of object and keypoint are kept: those of all objects on display. */
const KEPT_SERIES = 32;

export class Score extends EventTarget {
  /** @type {Scoring | null} */
  scoring = null;
  /** @type {Evaluation | null} */
  evaluation = null;
  /** The saved evaluation on display, when nothing is scored. @type {Saved | null} */
  savedIn = null;
  /**
   * Thresholds that apply where none is set, by object, as far as known.
   * @type {Map<string, number>}
   */
  defaultThresholds = new Map();
  /** @type {Options} */
  options;
  /** What is asked of the sequences: folds to hold out (0: none), intervals. */
  resampling = { folds: 0, intervals: false };
  /** 95 % intervals of the evaluation, once they are drawn. @type {Intervals | null} */
  intervals = null;
  /** Of the joined frames. @type {string[]} */
  objects = [];
  /** The joined frames by sequence. @type {SequenceRange[]} */
  sequences = [];
  /** For each joined frame its number in its sequence. @type {Float64Array} */
  frameNumbers = new Float64Array();
  /** Object and joined frame on display. */
  selection = { object: 0, frame: 0 };

  #problems;
  #remembers;
  /** @type {CommandInputs | null} */
  #inputs = null;
  /**
   * Keypoints the user looks at in place of the best ones, by object.
   * @type {Map<number, number>}
   */
  #chosen = new Map();
  /** @type {Points["pictures"]} */
  #pictures = [];
  /** @type {Points["sizes"]} */
  #sizes = [];
  /** @type {OpenEncoder | null} */
  #encoder = null;
  /** The last ones asked for. @type {Map<string, Series>} */
  #series = new Map();

  /**
   * @param {import("./files/problems.js").Problems} problems
   * @param {{ remembers: boolean }} settings whether options outlast the page
   */
  constructor(problems, { remembers }) {
    super();
    this.#problems = problems;
    this.#remembers = remembers;
    this.options = this.#startOptions();
  }

  // What is scored

  /**
   * Scores other points.
   * @param {Points} points
   */
  show({ scoring, pictures, sizes, encoder, inputs }) {
    this.scoring = scoring;
    this.objects = scoring.objects;
    this.sequences = scoring.sequences;
    this.frameNumbers = scoring.frameNumbers;
    this.#pictures = pictures;
    this.#sizes = sizes;
    this.#encoder = encoder;
    this.#inputs = inputs;
    this.selection = {
      object: Math.min(this.selection.object, this.objects.length - 1),
      frame: Math.min(this.selection.frame, this.frameNumbers.length - 1),
    };
    this.#evaluate();
    this.#remind();
  }

  /**
   * Shows an evaluation that was saved.
   * @param {Saved} saved
   */
  showSaved(saved) {
    const { evaluation } = saved.evaluation;
    this.savedIn = saved;
    this.evaluation = evaluation;
    this.objects = evaluation.objects.map(({ name }) => name);
    this.selection = { object: Math.min(this.selection.object, this.objects.length - 1), frame: 0 };
    this.emit("evaluation");
  }

  /** Forgets the points; whoever made them gives them back. */
  forget() {
    this.scoring = null;
    this.evaluation = null;
    this.savedIn = null;
    this.intervals = null;
    this.objects = [];
    this.sequences = [];
    this.frameNumbers = new Float64Array();
    this.#pictures = [];
    this.#sizes = [];
    this.#encoder = null;
    this.#inputs = null;
    this.#chosen.clear();
    this.#series.clear();
  }

  /** As on a fresh page. */
  resetOptions() {
    this.options = this.#startOptions();
    this.resampling = { folds: 0, intervals: false };
  }

  /** The evaluation that was saved and is on display. */
  get saved() {
    return this.savedIn?.evaluation ?? null;
  }

  // How

  /** @param {Partial<Pick<Options, "transform" | "rank">>} options */
  setOptions(options) {
    Object.assign(this.options, options);
    this.#remember();
    this.#evaluate();
  }

  /**
   * @param {string} object
   * @param {number | null} threshold `null` for the default
   */
  setThreshold(object, threshold) {
    const { thresholds } = this.options;
    if (threshold === null || threshold === this.defaultThresholds.get(object)) {
      thresholds.delete(object);
    } else thresholds.set(object, threshold);
    this.#remember();
    this.#evaluate();
  }

  /** @param {Partial<Score["resampling"]>} resampling */
  setResampling(resampling) {
    Object.assign(this.resampling, resampling);
    this.#evaluate();
  }

  /** The held-out errors, if they are asked for in place of those on the same frames. */
  get shownHeldOut() {
    return this.folds > 0 ? this.evaluation?.held_out : undefined;
  }

  /** The number of folds that are held out; no more than there are sequences. */
  get folds() {
    const folds = Math.min(this.resampling.folds, this.sequences.length);
    return folds < 2 ? 0 : folds;
  }

  /**
   * The evaluation with all that belongs to it: intervals, errors by sequence, other metrics, the
   * command.
   * @returns {Evaluation | null}
   */
  completeEvaluation() {
    if (!this.scoring || !this.evaluation) return this.evaluation;
    const options = { ...this.#scoreOptions(), sequences: true, context: true };
    const evaluation = this.scoring.evaluate(options);
    if (this.intervals) evaluation.intervals = this.intervals;
    return { ...evaluation, command: this.command() };
  }

  /** Other metrics of the same frames; takes a while. */
  context() {
    const evaluation = this.scoring?.evaluate({ ...this.#scoreOptions(), context: true });
    return evaluation?.context ?? this.evaluation?.context ?? null;
  }

  /** The command of the terminal that repeats the evaluation. */
  command() {
    if (!this.scoring || !this.#inputs) return this.evaluation?.command ?? "";
    const bootstrap =
      this.resampling.intervals && this.sequences.length > 1 ? { bootstrap: RESAMPLES } : {};
    return this.scoring.command(this.#inputs, { ...this.#scoreOptions(), ...bootstrap });
  }

  // On display

  /** @param {Partial<{ object: number, frame: number }>} selection */
  select(selection) {
    const next = { ...this.selection, ...selection };
    if (next.object === this.selection.object && next.frame === this.selection.frame) return;
    this.selection = next;
    this.emit("selection");
  }

  /**
   * The keypoint on display for an object: the chosen one, otherwise the best; `null` when it is
   * visible in no frame.
   * @param {number} object
   */
  keypointOf(object) {
    const best = this.evaluation?.objects[object]?.best_keypoint ?? null;
    return best === null ? null : (this.#chosen.get(object) ?? best);
  }

  /**
   * Shows an object with a keypoint other than its best one.
   * @param {number} object
   * @param {number | null} keypoint `null` for the best one
   */
  choose(object, keypoint) {
    if (keypoint === null) this.#chosen.delete(object);
    else this.#chosen.set(object, keypoint);
    this.selection = { ...this.selection, object };
    for (const topic of ["selection", "choice"]) this.emit(topic);
  }

  /** Shows every object with its best keypoint. */
  chooseBest() {
    this.#chosen.clear();
    for (const topic of ["selection", "choice"]) this.emit(topic);
  }

  /**
   * Whether an object is shown with a keypoint other than its best one.
   * @param {number} object
   */
  isChosen(object) {
    return this.keypointOf(object) !== (this.evaluation?.objects[object]?.best_keypoint ?? null);
  }

  /**
   * The error of an object with a keypoint by sequence, the worst one first.
   * @param {number} object
   * @param {number} keypoint
   */
  errorsBySequence(object, keypoint) {
    if (!this.scoring) return this.saved?.errorsBySequence(object, keypoint) ?? [];
    return this.scoring.sequenceErrors(object, keypoint, this.#mapOptions());
  }

  /**
   * The frames in which an object is furthest from a keypoint under its map (squared distance,
   * ndc), with their positions among the joined ones; of a saved evaluation the worst one of each
   * sequence, at no position (-1).
   * @param {number} object
   * @param {number} keypoint
   * @param {number} most
   * @returns {{ position: number, sequence: string, frame: number, distance: number }[]}
   */
  worstFrames(object, keypoint, most) {
    const { scoring } = this;
    if (!scoring) {
      const worst = this.errorsBySequence(object, keypoint).map(
        ({ sequence, worst: position, worstFrame: frame, worstError: distance }) => ({
          ...{ position, sequence, frame, distance },
        }),
      );
      return worst.sort((a, b) => b.distance - a.distance).slice(0, most);
    }
    const distances = scoring.distances(object, keypoint, this.#mapOptions());
    const visible = Array.from(distances, (distance, position) => ({ position, distance })).filter(
      ({ distance }) => !Number.isNaN(distance),
    );
    const worst = visible.sort((a, b) => b.distance - a.distance).slice(0, most);
    return worst.map(({ position, distance }) => ({
      ...{ position, distance },
      sequence: this.sequenceOf(position)?.name ?? "",
      frame: this.frameNumbers[position],
    }));
  }

  /** Width and height of the images, when it is known and the same for all. */
  get imageSize() {
    return this.#sizes.length === 1 ? this.#sizes[0] : null;
  }

  /**
   * Whether raw keypoints are shown where the encoder's grid places them; otherwise they are taken
   * as ndc.
   */
  get placesKeypoints() {
    return this.#encoder !== null && this.#sizes.length > 0;
  }

  /**
   * The image of a joined frame.
   * @param {number} frame
   */
  picture(frame) {
    return this.#pictures[frame] ?? null;
  }

  /** Whether any joined frame has an image. */
  get hasPictures() {
    return this.#pictures.some((picture) => picture !== null);
  }

  /**
   * The sequence a joined frame belongs to.
   * @param {number} frame
   * @returns {SequenceRange | null}
   */
  sequenceOf(frame) {
    return (
      this.sequences.find(({ start, length }) => frame >= start && frame < start + length) ?? null
    );
  }

  /**
   * The points of an object and its keypoint on display, all in ndc, with their squared distances;
   * `null` when it has none.
   * @param {number} object
   */
  series(object) {
    const keypoint = this.keypointOf(object);
    if (!this.scoring || keypoint === null) return null;
    const key = `${object} ${keypoint}`;
    let series = this.#series.get(key);
    if (series) {
      // The oldest is the one not asked for longest.
      this.#series.delete(key);
      this.#series.set(key, series);
    } else {
      const options = this.#mapOptions();
      const { truth, keypoint: raw, transformed } = this.scoring.series(object, keypoint, options);
      const distances = this.scoring.distances(object, keypoint, options);
      series = { truth, keypoint: this.#place(raw), transformed, distances };
      const [oldest] = this.#series.keys();
      if (this.#series.size >= KEPT_SERIES) this.#series.delete(oldest);
      this.#series.set(key, series);
    }
    return series;
  }

  /**
   * The errors of an object and its keypoint on display by the sequence, in the order of
   * `sequences`; NaN where the object is not visible.
   * @param {number} object
   */
  sequenceErrors(object) {
    const errors = new Float64Array(this.sequences.length).fill(NaN);
    const keypoint = this.keypointOf(object);
    if (!this.scoring || keypoint === null) return errors;
    const found = this.errorsBySequence(object, keypoint);
    const byStart = new Map(found.map(({ start, error }) => [start, error]));
    return errors.map((_, i) => byStart.get(this.sequences[i].start) ?? NaN);
  }

  /**
   * All keypoints of a joined frame in ndc, N x 2.
   * @param {number} frame
   */
  keypointsAt(frame) {
    return this.scoring ? this.placed(this.scoring.keypointsAt(frame), frame) : new Float64Array();
  }

  /**
   * Points of a joined frame in ndc; see {@link Score.placesKeypoints}.
   * @param {Float64Array} points
   * @param {number} frame
   */
  placed(points, frame) {
    const size = this.imageSize ?? this.#sizes[frame];
    return this.#encoder && size
      ? latentToImage(this.#encoder.info.config, points, ...size)
      : points;
  }

  // What follows

  /** Those of the last visit, where there was one. */
  #startOptions() {
    return optionsFrom(this.#remembers ? load("score") : {});
  }

  #remember() {
    const { transform, rank } = this.options;
    const thresholds = Object.fromEntries(this.options.thresholds);
    if (this.#remembers) store("score", { transform, rank, thresholds });
    this.#dropReminder();
  }

  /** Says which settings of an earlier visit are in force: a result must not surprise. */
  #remind() {
    const { transform, rank } = this.options;
    const kept = [
      ...this.#editedThresholds.map(([name, value]) => `threshold ${value} for ${name}`),
      transform !== DEFAULTS.transform && `map ${transform}`,
      rank !== DEFAULTS.rank && `rank rule ${rank}`,
    ].filter(Boolean);
    if (kept.length === 0 || !this.#remembers) return;
    this.#problems.report("remembered", "info", `Kept from your last visit: ${kept.join(", ")}.`, {
      label: "Use the defaults",
      run: () => this.#scoreByDefault(),
    });
  }

  /** Scores as on the first visit. */
  #scoreByDefault() {
    Object.assign(this.options, DEFAULTS, { thresholds: new Map() });
    this.#remember();
    this.#evaluate();
    this.emit("scoring");
  }

  #dropReminder() {
    if (this.#problems.delete("remembered")) this.#problems.changed();
  }

  #evaluate() {
    if (!this.scoring) return;
    this.#series.clear();
    try {
      this.evaluation = this.scoring.evaluate(this.#scoreOptions());
      this.#learnDefaults(this.evaluation);
      const [failed, undrawn] = ["evaluation", "intervals"].map((key) =>
        this.#problems.delete(key),
      );
      if (failed || undrawn) this.#problems.changed();
    } catch (error) {
      this.evaluation = null;
      this.#problems.report("evaluation", "error", messageOf(error), {
        label: "Score with the defaults",
        run: () => {
          Object.assign(this.resampling, { folds: 0, intervals: false });
          this.#scoreByDefault();
        },
      });
      this.#problems.changed();
    }
    this.intervals = null;
    this.emit("evaluation");
    void this.#drawIntervals();
  }

  /** The thresholds in force that were not set are the defaults. @param {Evaluation} evaluation */
  #learnDefaults({ objects }) {
    for (const { name, threshold } of objects) {
      if (!this.options.thresholds.has(name)) this.defaultThresholds.set(name, threshold);
    }
  }

  /** Draws the intervals in steps, until they are there or belong to another evaluation. */
  async #drawIntervals() {
    const { scoring, evaluation } = this;
    if (!scoring || !evaluation || !this.resampling.intervals || this.sequences.length < 2) return;
    /** @type {import("./pkg/index.js").Bootstrap | undefined} */
    let bootstrap;
    try {
      bootstrap = scoring.bootstrap(this.#scoreOptions());
      let step = 1;
      for (let left = RESAMPLES; left > 0;) {
        await new Promise((done) => setTimeout(done));
        if (this.evaluation !== evaluation) return;
        const start = performance.now();
        bootstrap.draw(Math.min(step, left));
        left -= step;
        if (performance.now() - start < STEP_MS / 2) step *= 2;
      }
      this.intervals = bootstrap.intervals();
      this.emit("intervals");
    } catch (error) {
      this.resampling.intervals = false;
      const text = `The intervals cannot be computed: ${messageOf(error)}`;
      this.#problems.report("intervals", "error", text);
      this.#problems.changed();
      this.emit("scoring");
    } finally {
      bootstrap?.free();
    }
  }

  /** Thresholds that were edited, of the objects here. */
  get #editedThresholds() {
    return [...this.options.thresholds].filter(([name]) => this.objects.includes(name));
  }

  /** What decides on the maps alone. @returns {ScoreOptions} */
  #mapOptions() {
    const { transform, rank } = this.options;
    return { transform, rank };
  }

  /** @returns {ScoreOptions} */
  #scoreOptions() {
    return {
      ...this.#mapOptions(),
      thresholds: Object.fromEntries(this.#editedThresholds),
      ...(this.imageSize ? { imageSize: this.imageSize } : {}),
      ...(this.folds > 0 ? { folds: this.folds } : {}),
    };
  }

  /**
   * Latent points of the joined frames in the image.
   * @param {Float64Array} points
   */
  #place(points) {
    if (!this.#encoder || this.#sizes.length === 0) return points;
    const { config } = this.#encoder.info;
    if (this.imageSize) return latentToImage(config, points, ...this.imageSize);
    const placed = new Float64Array(points.length);
    for (let t = 0; t < this.#sizes.length; t++)
      placed.set(this.placed(points.slice(2 * t, 2 * t + 2), t), 2 * t);
    return placed;
  }

  /** @param {string} topic */
  emit(topic) {
    this.dispatchEvent(new Event(topic));
  }
}

/**
 * Options that were kept, as far as they are understood.
 * @param {Record<string, any>} kept
 * @returns {Options}
 */
function optionsFrom({ transform, rank, thresholds }) {
  const isUsable = (/** @type {unknown} */ value) => Number.isFinite(value) && Number(value) > 0;
  const usable = Object.entries(thresholds ?? {}).filter(([, value]) => isUsable(value));
  return {
    transform: TRANSFORMS.includes(transform) ? transform : DEFAULTS.transform,
    rank: RANKS.includes(rank) ? rank : DEFAULTS.rank,
    thresholds: new Map(usable),
  };
}
