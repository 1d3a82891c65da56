// @ts-check
/**
 * Runs side by side: folders of runs that were dropped, and the detectors of the session that are scored on the same
 * frames. Says `change` when there is something else to compare.
 */

import init, { Comparison, Scoring } from "./pkg/index.js";
import { bytesOf, mapBounded } from "./files.js";
import { splitRuns } from "./runs.js";

/**
 * @typedef {import("./session.js").Session} Session
 * @typedef {import("./intake.js").Entry} Entry
 * @typedef {import("./extractor.js").OpenEncoder} OpenEncoder
 * @typedef {import("./files.js").Source} Source
 * @typedef {import("./runs.js").RunFolder} RunFolder
 * @typedef {import("./pkg/index.js").Compared} Compared
 * @typedef {import("./pkg/index.js").Evaluation} Evaluation
 * @typedef {import("./pkg/index.js").RunDataSet} RunDataSet
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
  /** Detectors that cannot be scored on the frames here, with the reason. @type {{ name: string, reason: string }[]} */
  unscored = [];
  /** The runs of the data set on display; `null` when none of them is complete. @type {Compared | null} */
  compared = null;
  /** Why nothing is compared. */
  error = "";
  options = { dataSet: 0, groupBy: "settings" };

  /** Bytes by folder. @type {Map<string, Record<string, Uint8Array>>} */
  #runs = new Map();
  /**
   * What was scored, by detector: an entry is scored again only when something else is asked of it.
   * @type {Map<Entry, { key: string, content: Entry["content"], evaluation: Evaluation | null, reason: string }>}
   */
  #scores = new Map();
  #session;
  /** @type {Comparison | null} */
  #comparison = null;
  /** Changes are made one after the other. @type {Promise<void>} */
  #queue = Promise.resolve();
  #scheduled = false;

  /** @param {Session} session */
  constructor(session) {
    super();
    this.#session = session;
    for (const topic of ["files", "scoring", "evaluation", "extraction"]) {
      session.addEventListener(topic, () => this.#schedule());
    }
  }

  /** The number of run folders. */
  get size() {
    return this.#runs.size;
  }

  /**
   * Takes the folders of runs out of what was dropped and returns the rest.
   * @param {Source[]} sources
   */
  take(sources) {
    const { runs, rest } = splitRuns(sources);
    if (runs.size > 0) this.#change(() => this.#read(runs));
    return { rest, runs: runs.size };
  }

  /** Removes the folders of runs. */
  clear() {
    this.#change(async () => this.#runs.clear());
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
      await extraction?.run(this.#session.frameSources, () => this.dispatchEvent(new Event("progress")));
    }
    this.#schedule();
  }

  /** @param {Map<string, RunFolder>} runs */
  async #read(runs) {
    let done = 0;
    await mapBounded([...runs], READERS, async ([name, folder]) => {
      /** @type {Record<string, Uint8Array>} */
      const files = {};
      for (const [kind, source] of Object.entries(folder)) files[kind] = await bytesOf(source);
      this.#runs.set(name, files);
      this.reading = { done: ++done, total: runs.size };
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
        await this.#compare();
      } catch (error) {
        this.reading = null;
        this.compared = null;
        this.error = error instanceof Error ? error.message : String(error);
      }
      this.dispatchEvent(new Event("change"));
    });
  }

  async #compare() {
    const detectors = this.#detectors();
    this.compared?.free();
    this.compared = null;
    this.#comparison?.free();
    this.#comparison = null;
    this.error = "";
    this.dataSets = [];
    this.unread = [];
    // One detector is no comparison: the page shows its score anyway.
    const scored = detectors.length + this.pending.length > 1 ? detectors : [];
    if (this.#runs.size === 0 && scored.length === 0) return;
    await init(["figures"]);
    const comparison = new Comparison();
    this.#comparison = comparison;
    for (const { name, evaluation, architecture } of scored) comparison.addEvaluation(name, evaluation, architecture);
    for (const [name, files] of this.#runs) comparison.addRun(name, files);
    this.dataSets = comparison.dataSets;
    this.unread = comparison.unread;
    if (this.options.dataSet >= this.dataSets.length) this.options.dataSet = 0;
    const set = this.dataSets[this.options.dataSet];
    if (!set) return;
    const known = ["settings", "architecture", "name", ...set.settings];
    if (!known.includes(this.options.groupBy)) this.options.groupBy = "settings";
    const given = Object.entries(this.#session.options.thresholds ?? {});
    const thresholds = Object.fromEntries(given.filter(([object]) => set.objects.includes(object)));
    try {
      this.compared = comparison.compare({ ...this.options, thresholds });
    } catch (error) {
      this.error = error instanceof Error ? error.message : String(error);
    }
  }

  /** The detectors of the session that have keypoints of the frames, scored as the session scores. */
  #detectors() {
    const { truth, frames, frameSources, entries, options } = this.#session;
    this.pending = [];
    this.unscored = [];
    /** @type {{ name: string, evaluation: Evaluation, architecture?: string }[]} */
    const detectors = [];
    for (const entry of this.#scores.keys()) if (!entries.includes(entry)) this.#scores.delete(entry);
    if (!truth) return detectors;
    for (const entry of entries) {
      if (!entry.content || (entry.role !== "keypoints" && entry.role !== "checkpoint")) continue;
      const { extraction } = entry;
      if (entry.role === "checkpoint") {
        if (!frames || !extraction) continue;
        if (extraction.pending(frameSources).length > 0) {
          this.pending.push(entry);
          continue;
        }
      }
      const state = [truth.name, truth.frames, frameSources.length, extraction?.extracted.size];
      const key = JSON.stringify([state, options]);
      let score = this.#scores.get(entry);
      if (score?.key !== key || score.content !== entry.content) {
        score = { key, content: entry.content, ...this.#score(entry) };
        this.#scores.set(entry, score);
      }
      const architecture =
        entry.role === "checkpoint" ? /** @type {OpenEncoder} */ (entry.content).info.architecture : undefined;
      if (score.evaluation) detectors.push({ name: entry.path, evaluation: score.evaluation, architecture });
      else this.unscored.push({ name: entry.path, reason: score.reason });
    }
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
      let table = /** @type {import("./pkg/index.js").KeypointTable} */ (content);
      if (role === "checkpoint") {
        const found = extraction?.collect(/** @type {import("./pkg/index.js").FrameIndex} */ (frames), frameSources);
        if (!found) throw new Error("no frame has keypoints");
        made.push(found.table, ...(found.selected ? [found.selected] : []));
        table = found.table;
      }
      const scoring = new Scoring(/** @type {import("./pkg/index.js").GroundTruthTable} */ (truth), table);
      made.push(scoring);
      const thresholds = Object.entries(options.thresholds ?? {}).filter(([name]) => scoring.objects.includes(name));
      const evaluation = scoring.evaluate({ ...options, thresholds: Object.fromEntries(thresholds) });
      return { evaluation, reason: "" };
    } catch (error) {
      return { evaluation: null, reason: error instanceof Error ? error.message : String(error) };
    } finally {
      for (const each of made) each.free();
    }
  }
}
