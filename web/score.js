// @ts-check
/**
 * A score: joined points, how they are scored, what comes out, and what of it is on display. A
 * session fills it from files. The views listen to its events: `scoring` (another set of joined
 * points), `evaluation` (other options for the same points), `intervals`, `preview` (what can be
 * looked at before there is a score), `selection` and `choice` (a keypoint other than the best one).
 */

import { messageOf } from "./errors.js";
import { fragmentOf, settingsIn } from "./fragment.js";
import { Points } from "./points.js";
import { load, store } from "./settings.js";

/**
 * @typedef {import("./files/saved.js").SavedEvaluation} SavedEvaluation
 * @typedef {import("./pkg/index.js").CommandInputs} CommandInputs
 * @typedef {import("./pkg/index.js").Evaluation} Evaluation
 * @typedef {import("./pkg/index.js").Finding} Finding
 * @typedef {import("./pkg/index.js").Intervals} Intervals
 * @typedef {import("./pkg/index.js").ScoreOptions} ScoreOptions
 * @typedef {import("./pkg/index.js").TemporalQuality} TemporalQuality
 * @typedef {import("./pkg/index.js").Scoring} Scoring
 *
 * How points are scored. `rank` is `null` for the rule that belongs to the keypoints; `thresholds`
 * holds those that were edited, by object.
 * @typedef {{ transform: Evaluation["transform"], rank: Evaluation["rank"] | null, thresholds:
 * Map<string, number> }} Options
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
const DEFAULTS = /** @type {const} */ ({ transform: "affine", rank: null });

export class Score extends EventTarget {
  /** The points that are scored. @type {Points | null} */
  points = null;
  /** @type {Evaluation | null} */
  evaluation = null;
  /** What is there before it can be scored. @type {Points | null} */
  preview = null;
  /** The score of the keypoints that are there so far. @type {Evaluation | null} */
  provisional = null;
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
  resampling;
  /** 95 % intervals of the evaluation, once they are drawn. @type {Intervals | null} */
  intervals = null;
  /**
   * Measures over time that belong to the evaluation, once they were asked for.
   * @type {TemporalQuality | null}
   */
  temporal = null;
  /** Object and joined frame on display. */
  selection = { object: 0, frame: 0 };

  #problems;
  #remembers;
  /** @type {CommandInputs | null} */
  #inputs = null;
  /** @type {Finding[]} */
  #findings = [];
  /**
   * Keypoints the user looks at in place of the best ones, by object.
   * @type {Map<number, number>}
   */
  #chosen = new Map();

  /**
   * @param {import("./files/problems.js").Problems} problems
   * @param {{ remembers: boolean }} settings whether options outlast the page
   */
  constructor(problems, { remembers }) {
    super();
    this.#problems = problems;
    this.#remembers = remembers;
    this.options = this.#startOptions();
    this.resampling = this.#startResampling();
  }

  // What is scored

  /**
   * Scores other points.
   * @param {Points} points
   * @param {CommandInputs | null} inputs the files, as a command names them
   * @param {Finding[]} findings what looks wrong with the data
   */
  show(points, inputs, findings) {
    this.preview = null;
    this.#findings = findings;
    this.provisional = null;
    this.points = points;
    this.#inputs = inputs;
    this.#keepSelection();
    this.#evaluate();
    this.#remind();
  }

  /**
   * Shows what is there before it can be scored.
   * @param {Points | null} points
   * @param {Evaluation | null} provisional of the frames that have keypoints already
   */
  showPreview(points, provisional) {
    if (!points && !this.preview) return;
    this.preview = points;
    this.provisional = points?.scoring ? provisional : null;
    if (points) this.#keepSelection();
    this.emit("preview");
  }

  /**
   * An evaluation under the options of the score; `null` where there is too little for one yet.
   * @param {Scoring} scoring
   */
  evaluateSoFar(scoring) {
    try {
      return scoring.evaluate(this.#scoreOptions());
    } catch {
      // What is wrong with the options is said with the score.
      return null;
    }
  }

  #keepSelection() {
    this.selection = {
      object: Math.max(0, Math.min(this.selection.object, this.objects.length - 1)),
      frame: Math.min(this.selection.frame, this.frameNumbers.length - 1),
    };
  }

  /**
   * Shows an evaluation that was saved.
   * @param {Saved} saved
   */
  showSaved(saved) {
    const { evaluation } = saved.evaluation;
    this.savedIn = saved;
    this.evaluation = evaluation;
    this.selection = { object: Math.min(this.selection.object, this.objects.length - 1), frame: 0 };
    this.emit("evaluation");
  }

  /** Forgets the points; whoever made them gives them back. */
  forget() {
    this.points = null;
    this.evaluation = null;
    this.preview = null;
    this.provisional = null;
    this.savedIn = null;
    this.intervals = null;
    this.temporal = null;
    this.#inputs = null;
    this.#chosen.clear();
  }

  /** As on a fresh page. */
  resetOptions() {
    this.options = this.#startOptions();
    this.resampling = this.#startResampling();
  }

  /** What is scored, when something is. */
  get scoring() {
    return this.points?.scoring ?? null;
  }

  /** The frames on display. */
  get shown() {
    return this.points ?? this.preview;
  }

  /** Of the frames on display, or of a saved evaluation. @returns {string[]} */
  get objects() {
    if (this.shown) return this.shown.objects;
    return this.savedIn ? this.savedIn.evaluation.evaluation.objects.map(({ name }) => name) : [];
  }

  /** The frames on display by sequence. */
  get sequences() {
    return this.shown?.sequences ?? [];
  }

  /** For each frame on display its number in its sequence. */
  get frameNumbers() {
    return this.shown?.frameNumbers ?? new Float64Array();
  }

  /** The evaluation that was saved and is on display. */
  get saved() {
    return this.savedIn?.evaluation ?? null;
  }

  // How

  /**
   * Takes options from a file, as far as they are understood; they are scored with the next points.
   * @param {{ transform: string, rank: string | null, thresholds: Record<string, number> }} given
   */
  takeOptions(given) {
    this.options = optionsFrom(given);
  }

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
    // The other metrics are of points in the image.
    const more = { sequences: true, context: this.isInImage };
    const evaluation = this.scoring.evaluate({ ...this.#scoreOptions(), ...more });
    if (this.intervals) evaluation.intervals = this.intervals;
    if (this.temporal) evaluation.temporal = this.temporal;
    const command = this.#commandWith({ ...more, temporal: this.temporal !== null });
    return this.#withFindings({ ...evaluation, ...(command ? { command } : {}) });
  }

  /** @param {Evaluation} evaluation */
  #withFindings(evaluation) {
    return this.#findings.length > 0 ? { ...evaluation, findings: this.#findings } : evaluation;
  }

  /** Other metrics of the same frames; takes a while. */
  context() {
    const evaluation = this.scoring?.evaluate({ ...this.#scoreOptions(), context: true });
    return evaluation?.context ?? this.evaluation?.context ?? null;
  }

  /**
   * Measures over time of the same frames, which take a while; of a saved evaluation those that it
   * has.
   * @param {(options: ScoreOptions) => TemporalQuality | null} measure
   */
  measure(measure) {
    if (!this.scoring) return this.evaluation?.temporal ?? null;
    this.temporal ??= measure(this.#scoreOptions());
    return this.temporal;
  }

  /** The command of the terminal that repeats the evaluation. */
  command() {
    return this.#commandWith({});
  }

  /** @param {ScoreOptions} more what else is asked for */
  #commandWith(more) {
    if (!this.scoring || !this.#inputs) return this.evaluation?.command ?? "";
    const bootstrap =
      this.resampling.intervals && this.sequences.length > 1 ? { bootstrap: RESAMPLES } : {};
    return this.scoring.command(this.#inputs, { ...this.#scoreOptions(), ...bootstrap, ...more });
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
    const best = this.judged?.objects[object]?.best_keypoint ?? null;
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
    return this.keypointOf(object) !== (this.judged?.objects[object]?.best_keypoint ?? null);
  }

  /** The evaluation that says which keypoints are shown: that of the score, or of what is there. */
  get judged() {
    return this.evaluation ?? this.provisional;
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

  /** The numbers of coordinates of a keypoint and of an object: 2 in the image, 3 in space. */
  get axes() {
    const { dimensions } = this.savedIn?.evaluation.evaluation ?? {};
    return dimensions ? [dimensions.keypoints, dimensions.truth] : (this.shown?.axes ?? [2, 2]);
  }

  /** Whether keypoints and objects are both in the image. */
  get isInImage() {
    return this.axes.every((axes) => axes === 2);
  }

  /** Whether objects are in space: errors are in their unit, and nothing says where they are seen. */
  get isInSpace() {
    return this.axes[1] === 3;
  }

  get imageSize() {
    return this.shown?.imageSize ?? null;
  }

  get placesKeypoints() {
    return this.shown?.placesKeypoints ?? false;
  }

  /** @param {number} frame */
  picture(frame) {
    return this.shown?.picture(frame) ?? null;
  }

  get hasPictures() {
    return this.shown?.hasPictures ?? false;
  }

  /** @param {number} frame */
  sequenceOf(frame) {
    return this.shown?.sequenceOf(frame) ?? null;
  }

  /**
   * The points of an object and its keypoint on display; `null` when it has none. Before there are
   * keypoints, those of the object alone.
   * @param {number} object
   */
  series(object) {
    const keypoint = this.keypointOf(object);
    if (keypoint !== null) return this.shown?.series(object, keypoint, this.#mapOptions()) ?? null;
    return this.preview?.truthOf(object) ?? null;
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

  /** @param {number} frame */
  keypointsAt(frame) {
    return this.shown?.keypointsAt(frame) ?? new Float64Array();
  }

  /**
   * @param {Float64Array} points
   * @param {number} frame
   */
  placed(points, frame) {
    return this.shown?.placed(points, frame) ?? points;
  }

  // What follows

  /** Those of the link, or of the last visit, where there are any. */
  #startOptions() {
    if (!this.#remembers) return optionsFrom({});
    return optionsFrom(settingsIn(location.hash) ?? load("score"));
  }

  #startResampling() {
    const given = this.#remembers ? settingsIn(location.hash) : null;
    return { folds: given?.folds ?? 0, intervals: given?.intervals ?? false };
  }

  /** Puts the settings into the page's address, which can be copied then. */
  #tellAddress() {
    if (!this.#remembers) return;
    const options = { ...this.options, thresholds: new Map(this.#editedThresholds) };
    const fragment = fragmentOf(options, this.resampling, DEFAULTS);
    const before = settingsIn(location.hash) ? location.hash : "";
    if (fragment !== before)
      history.replaceState(null, "", fragment || `${location.pathname}${location.search}`);
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
      rank !== null && `rank rule ${rank}`,
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
    this.points?.forgetSeries();
    try {
      this.evaluation = this.#withFindings(this.scoring.evaluate(this.#scoreOptions()));
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
    this.temporal = null;
    this.#tellAddress();
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
