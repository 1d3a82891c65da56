// @ts-check
/**
 * Runs side by side: folders of trainings and agents that were dropped, the detectors of the session
 * that are scored on the same frames, and evaluations that were saved. Says `change` when there is something
 * else to compare.
 */

import init, { Comparison, checkpointCrc32 } from "../pkg/index.js";
import { messageOf } from "../errors.js";
import { contentOf, extractionOf, savedOf } from "../files/entry.js";
import { bytesOf, mapBounded, readError } from "../files/sources.js";
import { doubtsOf, isPending, scoreDetector } from "./detectors.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../files/entry.js").Entry} Entry
 * @typedef {import("../files/runs.js").RunFolder} RunFolder
 * @typedef {import("../files/sources.js").Source} Source
 * @typedef {import("./detectors.js").Detector} Detector
 * @typedef {import("../extraction/extraction.js").Extraction} Extraction
 * @typedef {import("../pkg/index.js").Compared} Compared
 * @typedef {import("../pkg/index.js").Evaluation} Evaluation
 * @typedef {import("../pkg/index.js").RunDataSet} RunDataSet
 * @typedef {import("../pkg/index.js").ComparedAgent} ComparedAgent
 */

/** The checkpoints in the folder of a training. @type {("best" | "last")[]} */
const CHECKPOINTS = ["best", "last"];
const READERS = 8;

export class RunsComparison extends EventTarget {
  /** Folders under way. @type {{ done: number, total: number } | null} */
  reading = null;
  /** @type {RunDataSet[]} */
  dataSets = [];
  /** The runs of agents, which are compared beside any data set. @type {ComparedAgent[]} */
  agents = [];
  /**
   * The extraction of pending checkpoints, while it runs.
   * @type {{ path: string, done: number, total: number, rate: number } | null}
   */
  extracting = null;
  /** Why checkpoints could not be extracted, by path. @type {Map<string, string>} */
  failed = new Map();
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
   * The runs of the data set on display and the agents; `null` when none of them is complete.
   * @type {Compared | null}
   */
  compared = null;
  /** The detectors that are scored here, and saved evaluations. @type {Detector[]} */
  detectors = [];
  /** In what the saved evaluations differ. @type {string[]} */
  doubts = [];
  /** Why nothing is compared. */
  error = "";
  /** `groupBy` is for trainings; scored detectors are compared one by one. */
  options = { dataSet: 0, groupBy: "settings" };

  /**
   * What was read of the folders of runs, by path: bytes, or why there are none.
   * @type {Map<string, { folder: RunFolder, files: Record<string, Uint8Array>, reason: string }>}
   */
  #runs = new Map();
  /** CRC-32 of checkpoints that were asked for. @type {WeakMap<Source, number>} */
  #crc32s = new WeakMap();
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
  /** @type {Extraction | null} */
  #running = null;
  #isCancelled = false;

  /** @param {Session} session */
  constructor(session) {
    super();
    this.#session = session;
    session.addEventListener("files", () => this.#schedule());
    session.addEventListener("extraction", () => {
      // A running extraction says so at every frame.
      if (session.extraction?.status !== "running") this.#schedule();
    });
    for (const topic of ["scoring", "evaluation"]) {
      session.score.addEventListener(topic, () => this.#schedule());
    }
  }

  /** The number of saved evaluations. */
  get saved() {
    return this.#saved.length;
  }

  get #saved() {
    return this.#session.library.entries.flatMap((entry) => {
      const saved = savedOf(entry);
      return saved ? [{ path: entry.path, evaluation: saved.evaluation }] : [];
    });
  }

  /** The number of run folders. */
  get size() {
    return this.#session.library.runs.size;
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
    if (this.extracting) return;
    const { frameSources } = this.#session;
    this.#isCancelled = false;
    for (const entry of this.pending) {
      const { path } = entry;
      const extraction = extractionOf(entry);
      if (!extraction || this.#isCancelled || extraction.status === "running") continue;
      const progress = () => {
        const done = frameSources.length - extraction.pending(frameSources).length;
        this.extracting = { path, done, total: frameSources.length, rate: extraction.rate };
        this.dispatchEvent(new Event("progress"));
      };
      this.#running = extraction;
      progress();
      await extraction.run(frameSources, progress);
      if (extraction.status === "failed") this.failed.set(path, extraction.error);
      else this.failed.delete(path);
    }
    this.#running = null;
    this.extracting = null;
    this.#schedule();
  }

  /** Stops extracting; the frames done are kept. */
  cancel() {
    this.#isCancelled = true;
    this.#running?.stop("cancelled");
  }

  /** Reads the folders that are new, and forgets those that are gone. */
  async #read() {
    const { runs } = this.#session.library;
    for (const name of this.#runs.keys()) if (!runs.has(name)) this.#runs.delete(name);
    const unread = [...runs].filter(([name, folder]) => this.#runs.get(name)?.folder !== folder);
    let done = 0;
    await mapBounded(unread, READERS, async ([name, folder]) => {
      /** @type {Record<string, Uint8Array>} */
      const files = {};
      let reason = "";
      try {
        const { best: _, last: __, ...described } = folder;
        for (const [kind, source] of Object.entries(described)) files[kind] = await bytesOf(source);
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
    this.detectors = detectors;
    // What is dropped on the example is compared with it: it is small.
    const isNew = this.pending.some((entry) => extractionOf(entry)?.status === "idle");
    if (this.#session.origin && this.#session.score.scoring && isNew) void this.extract();
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
      this.#comparison = await this.#gather(detectors);
      this.#parts = parts;
    }
    this.error = "";
    const set = this.dataSets[this.options.dataSet] ?? this.dataSets[0];
    if (!this.#comparison || (!set && this.agents.length === 0)) return;
    this.options.dataSet = Math.max(this.dataSets.indexOf(set), 0);
    const known = ["settings", "architecture", "name", ...(set?.settings ?? [])];
    if (!known.includes(this.options.groupBy)) this.options.groupBy = "settings";
    const given = [...this.#thresholds()].filter(([object]) => set?.objects.includes(object));
    const thresholds = Object.fromEntries(given);
    // Which settings of detectors differ is not known.
    const groupBy = set?.trained === false ? "name" : this.options.groupBy;
    const before = this.compared;
    this.compared = null;
    before?.free();
    try {
      this.compared = this.#comparison.compare({ ...this.options, groupBy, thresholds });
    } catch (error) {
      this.error = messageOf(error);
    }
  }

  /** @param {Detector[]} detectors */
  async #gather(detectors) {
    const comparison = new Comparison();
    for (const { name, evaluation, architecture } of detectors)
      comparison.addEvaluation(name, evaluation, architecture);
    const failed = [];
    for (const [name, { files, reason }] of this.#runs) {
      if (reason) failed.push({ name, reason });
      else comparison.addRun(name, files);
    }
    this.dataSets = comparison.dataSets;
    this.agents = comparison.agents;
    this.unread = [...comparison.unread, ...failed];
    if (this.agents.some((agent) => agent.seesByCheckpoint)) await this.#findEncoders(comparison);
    return comparison;
  }

  /**
   * Says which checkpoints trainings have, so that agents find their encoders.
   * @param {Comparison} comparison
   */
  async #findEncoders(comparison) {
    await mapBounded([...this.#runs], READERS, async ([name, { folder }]) => {
      const [best, last] = await Promise.all(
        CHECKPOINTS.map((kind) => this.#crc32Of(folder[kind], name)),
      );
      comparison.addCheckpoints(name, best, last);
    });
  }

  /**
   * @param {Source | undefined} source
   * @param {string} name of the run
   */
  async #crc32Of(source, name) {
    if (!source) return undefined;
    try {
      const crc32 = this.#crc32s.get(source) ?? checkpointCrc32(await bytesOf(source));
      this.#crc32s.set(source, crc32);
      return crc32;
    } catch (error) {
      this.unread.push({ name, reason: readError(error, source.path) });
      return undefined;
    }
  }

  #forget() {
    this.compared?.free();
    this.compared = null;
    this.#comparison?.free();
    this.#comparison = null;
    this.#parts = [];
    this.dataSets = [];
    this.agents = [];
    this.unread = [];
  }

  /**
   * The thresholds that count: those in force here, otherwise those of the saved evaluation on
   * display.
   */
  #thresholds() {
    const { scoring, options, saved } = this.#session.score;
    if (scoring || !saved) return options.thresholds;
    return new Map(saved.evaluation.objects.map(({ name, threshold }) => [name, threshold]));
  }

  /**
   * The detectors of the session that have keypoints of the frames, scored as the session scores,
   * and saved evaluations.
   */
  #detectors() {
    const session = this.#session;
    const { entries } = session.library;
    this.pending = [];
    this.unscored = [];
    this.doubts = [];
    /** @type {Detector[]} */
    const detectors = [];
    for (const entry of this.#scores.keys()) {
      if (!entries.includes(entry)) this.#scores.delete(entry);
    }
    const candidates = entries.filter((entry) => session.isCompared(entry));
    const saved = this.#saved;
    // One detector is no comparison: the page shows its score anyway.
    if (candidates.length + saved.length < 2) return detectors;
    for (const entry of candidates) {
      if (isPending(session, entry)) {
        this.pending.push(entry);
        continue;
      }
      const { evaluation, reason } = this.#scoreOf(entry);
      const content = contentOf(entry);
      const architecture =
        content?.kind === "checkpoint" ? content.encoder.info.architecture : undefined;
      if (evaluation) detectors.push({ name: entry.path, evaluation, architecture, entry });
      else this.unscored.push({ name: entry.path, reason });
    }
    for (const { path, evaluation } of saved) detectors.push({ name: path, evaluation });
    if (saved.length > 0) this.doubts = doubtsOf(detectors);
    return detectors;
  }

  /** @param {Entry} entry */
  #scoreOf(entry) {
    const { truth, frames, score } = this.#session;
    const { transform, rank, thresholds } = score.options;
    const extraction = extractionOf(entry);
    const asked = [
      contentOf(entry),
      truth,
      JSON.stringify([transform, rank, ...thresholds]),
      ...(extraction ? [frames, extraction.extracted.size] : []),
    ];
    let known = this.#scores.get(entry);
    if (!known || asked.some((value, i) => value !== known?.asked[i])) {
      known = { asked, ...scoreDetector(this.#session, entry) };
      this.#scores.set(entry, known);
    }
    return known;
  }
}
