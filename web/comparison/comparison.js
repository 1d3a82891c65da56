// @ts-check
/**
 * Runs side by side: folders of runs that were dropped, the detectors of the session that are
 * scored on the same frames, and evaluations that were saved. Says `change` when there is something
 * else to compare.
 */

import init, { Comparison, Scoring } from "../pkg/index.js";
import { messageOf } from "../errors.js";
import { bytesOf, mapBounded, readError } from "../files/sources.js";
import { count, significant } from "../ui/format.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../files/intake.js").Entry} Entry
 * @typedef {import("../extraction/extractor.js").OpenEncoder} OpenEncoder
 * @typedef {import("../files/runs.js").RunFolder} RunFolder
 * @typedef {import("../files/saved.js").SavedEvaluation} SavedEvaluation
 * @typedef {import("../pkg/index.js").Compared} Compared
 * @typedef {import("../pkg/index.js").Evaluation} Evaluation
 * @typedef {import("../pkg/index.js").RunDataSet} RunDataSet
 *
 * One that is scored.
 * @typedef {{ name: string, evaluation: Evaluation, architecture?: string }} Detector
 */

const READERS = 8;

export class RunsComparison extends EventTarget {
  /** Folders under way. @type {{ done: number, total: number } | null} */
  reading = null;
  /** @type {RunDataSet[]} */
  dataSets = [];
  /** Folders that cannot be read. @type {{ name: string, reason: string }[]} */
  unread = [];
  /** Checkpoints whose keypoints are not extracted, which so cannot be compared. @type {Entry[]} */
  pending = [];
  /**
   * Detectors that cannot be scored on the frames here, with the reason.
   * @type {{ name: string, reason: string }[]}
   */
  unscored = [];
  /**
   * The runs of the data set on display; `null` when none of them is complete.
   * @type {Compared | null}
   */
  compared = null;
  /** What the errors of saved evaluations have not in common. @type {string[]} */
  doubts = [];
  /** Why nothing is compared. */
  error = "";
  options = { dataSet: 0, groupBy: "settings" };

  /**
   * What was read of the folders of runs, by path: bytes, or why there are none.
   * @type {Map<string, { folder: RunFolder, files: Record<string, Uint8Array>, reason: string }>}
   */
  #runs = new Map();
  /**
   * What was scored, by detector: an entry is scored again only when something else is asked of it.
   * @type {Map<Entry, { asked: unknown[], evaluation: Evaluation | null, reason: string }>}
   */
  #scores = new Map();
  #session;
  /** @type {Comparison | null} */
  #comparison = null;
  /** What is in it. @type {unknown[]} */
  #parts = [];
  /** Changes are made one after the other. @type {Promise<void>} */
  #queue = Promise.resolve();
  #scheduled = false;

  /** @param {Session} session */
  constructor(session) {
    super();
    this.#session = session;
    for (const topic of ["files", "scoring", "evaluation", "extraction"]) {
      session.addEventListener(topic, () => {
        // Every frame of a running one says so.
        if (topic !== "extraction" || session.extraction?.status !== "running") this.#schedule();
      });
    }
  }

  /** The number of saved evaluations. */
  get saved() {
    return this.#saved.length;
  }

  get #saved() {
    return this.#session.entries.filter(
      ({ content, role }) => content !== null && role === "result",
    );
  }

  /** The number of run folders. */
  get size() {
    return this.#session.runs.size;
  }

  /** Removes the folders of runs. */
  clear() {
    void this.#session.removeRuns();
  }

  /** @param {Partial<RunsComparison["options"]>} options */
  setOptions(options) {
    this.#change(async () => {
      Object.assign(this.options, options);
    });
  }

  /** Extracts the keypoints of the checkpoints that have none yet, one after the other. */
  async extract() {
    for (const { extraction } of this.pending) {
      if (extraction?.status === "running") continue;
      await extraction?.run(this.#session.frameSources, () =>
        this.dispatchEvent(new Event("progress")),
      );
    }
    this.#schedule();
  }

  /** Reads the folders that are new, and forgets those that are gone. */
  async #read() {
    const { runs } = this.#session;
    for (const name of this.#runs.keys()) if (!runs.has(name)) this.#runs.delete(name);
    const unread = [...runs].filter(([name, folder]) => this.#runs.get(name)?.folder !== folder);
    let done = 0;
    await mapBounded(unread, READERS, async ([name, folder]) => {
      /** @type {Record<string, Uint8Array>} */
      const files = {};
      let reason = "";
      try {
        for (const [kind, source] of Object.entries(folder)) files[kind] = await bytesOf(source);
      } catch (error) {
        reason = readError(error, name);
      }
      this.#runs.set(name, { folder, files, reason });
      this.reading = { done: ++done, total: unread.length };
      this.dispatchEvent(new Event("progress"));
    });
    this.reading = null;
  }

  /** Events of the session come in bursts. */
  #schedule() {
    if (this.#scheduled) return;
    this.#scheduled = true;
    this.#change(async () => {
      this.#scheduled = false;
    });
  }

  /** @param {() => Promise<void>} change */
  #change(change) {
    this.#queue = this.#queue.then(async () => {
      try {
        await change();
        await this.#read();
        await this.#compare();
      } catch (error) {
        this.reading = null;
        this.#forget();
        this.error = messageOf(error);
      }
      this.dispatchEvent(new Event("change"));
    });
  }

  async #compare() {
    const detectors = this.#detectors();
    const parts = [
      ...this.#runs.values(),
      ...detectors.flatMap(({ name, evaluation }) => [name, evaluation]),
    ];
    if (parts.length === 0) this.#forget();
    else if (
      parts.length !== this.#parts.length ||
      parts.some((part, i) => part !== this.#parts[i])
    ) {
      await init(["comparison"]);
      this.#forget();
      this.#comparison = this.#gather(detectors);
      this.#parts = parts;
    }
    this.error = "";
    const set = this.dataSets[this.options.dataSet] ?? this.dataSets[0];
    if (!this.#comparison || !set) return;
    this.options.dataSet = this.dataSets.indexOf(set);
    const known = ["settings", "architecture", "name", ...set.settings];
    if (!known.includes(this.options.groupBy)) this.options.groupBy = "settings";
    const given = Object.entries(this.#thresholds());
    const thresholds = Object.fromEntries(given.filter(([object]) => set.objects.includes(object)));
    const before = this.compared;
    this.compared = null;
    before?.free();
    try {
      this.compared = this.#comparison.compare({ ...this.options, thresholds });
    } catch (error) {
      this.error = messageOf(error);
    }
  }

  /** @param {Detector[]} detectors */
  #gather(detectors) {
    const comparison = new Comparison();
    for (const { name, evaluation, architecture } of detectors)
      comparison.addEvaluation(name, evaluation, architecture);
    const failed = [];
    for (const [name, { files, reason }] of this.#runs) {
      if (reason) failed.push({ name, reason });
      else comparison.addRun(name, files);
    }
    this.dataSets = comparison.dataSets;
    this.unread = [...comparison.unread, ...failed];
    return comparison;
  }

  #forget() {
    this.compared?.free();
    this.compared = null;
    this.#comparison?.free();
    this.#comparison = null;
    this.#parts = [];
    this.dataSets = [];
    this.unread = [];
  }

  /**
   * The thresholds that count: those in force here, otherwise those of the saved evaluation on
   * display.
   */
  #thresholds() {
    const { scoring, options, saved } = this.#session;
    if (scoring || !saved) return options.thresholds ?? {};
    return Object.fromEntries(
      saved.evaluation.objects.map(({ name, threshold }) => [name, threshold]),
    );
  }

  /**
   * What saved evaluations differ in, so that their errors say less about the detectors.
   * @param {Detector[]} detectors
   */
  #doubt(detectors) {
    const differing = (
      /** @type {string} */ what,
      /** @type {(evaluation: Evaluation) => string} */ of,
    ) => {
      const values = new Set(detectors.map(({ evaluation }) => of(evaluation)));
      return values.size > 1 ? [`${what}: ${[...values].join(", ")}`] : [];
    };
    const names = new Set(
      detectors.flatMap(({ evaluation }) => evaluation.objects.map(({ name }) => name)),
    );
    const threshold =
      (/** @type {string} */ name) =>
      (/** @type {Evaluation} */ { objects }) =>
        significant(objects.find((object) => object.name === name)?.threshold);
    return [
      ...differing("These evaluations are of different numbers of frames", ({ frames }) =>
        count(frames, "frame"),
      ),
      ...differing("These evaluations differ in their rank rule", ({ rank }) => rank),
      ...[...names].flatMap((name) =>
        differing(
          `These evaluations were saved with different thresholds for ${name}, of which one ` +
            "counts for all here",
          threshold(name),
        ),
      ),
    ];
  }

  /**
   * The detectors of the session that have keypoints of the frames, scored as the session scores,
   * and saved evaluations.
   */
  #detectors() {
    const { truth, frames, frameSources, entries, options } = this.#session;
    this.pending = [];
    this.unscored = [];
    this.doubts = [];
    /** @type {Detector[]} */
    const detectors = [];
    for (const entry of this.#scores.keys())
      if (!entries.includes(entry)) this.#scores.delete(entry);
    const isDetector = (/** @type {Entry} */ { content, role }) =>
      content !== null && (role === "keypoints" || role === "checkpoint");
    const candidates = truth ? entries.filter(isDetector) : [];
    const saved = this.#saved;
    // One detector is no comparison: the page shows its score anyway.
    if (candidates.length + saved.length < 2) return detectors;
    for (const entry of candidates) {
      const { content, extraction } = entry;
      if (entry.role === "checkpoint") {
        if (!frames || !extraction) continue;
        if (extraction.pending(frameSources).length > 0) {
          this.pending.push(entry);
          continue;
        }
      }
      const asked = [
        content,
        truth,
        JSON.stringify(options),
        ...(extraction ? [frames, extraction.extracted.size] : []),
      ];
      let score = this.#scores.get(entry);
      if (!score || asked.some((value, i) => value !== score?.asked[i])) {
        score = { asked, ...this.#score(entry) };
        this.#scores.set(entry, score);
      }
      const architecture =
        entry.role === "checkpoint"
          ? /** @type {OpenEncoder} */ (entry.content).info.architecture
          : undefined;
      if (score.evaluation)
        detectors.push({ name: entry.path, evaluation: score.evaluation, architecture });
      else this.unscored.push({ name: entry.path, reason: score.reason });
    }
    for (const { path, content } of saved) {
      detectors.push({
        name: path,
        evaluation: /** @type {SavedEvaluation} */ (content).evaluation,
      });
    }
    if (saved.length > 0) this.doubts = this.#doubt(detectors);
    return detectors;
  }

  /**
   * @param {Entry} entry
   * @returns {{ evaluation: Evaluation | null, reason: string }}
   */
  #score({ role, content, extraction }) {
    const { truth, frames, frameSources, options } = this.#session;
    /** @type {{ free(): void }[]} */
    const made = [];
    try {
      let table = /** @type {import("../pkg/index.js").KeypointTable} */ (content);
      if (role === "checkpoint") {
        const found = extraction?.collect(
          /** @type {import("../pkg/index.js").FrameIndex} */ (frames),
          frameSources,
        );
        if (!found) throw new Error("no frame has keypoints");
        made.push(found.table, ...(found.selected ? [found.selected] : []));
        table = found.table;
      }
      const scoring = new Scoring(
        /** @type {import("../pkg/index.js").GroundTruthTable} */ (truth),
        table,
      );
      made.push(scoring);
      const thresholds = Object.entries(options.thresholds ?? {}).filter(([name]) =>
        scoring.objects.includes(name),
      );
      const evaluation = scoring.evaluate({
        ...options,
        thresholds: Object.fromEntries(thresholds),
      });
      return { evaluation, reason: "" };
    } catch (error) {
      return { evaluation: null, reason: messageOf(error) };
    } finally {
      for (const each of made) each.free();
    }
  }
}
