// @ts-check
/**
 * What the page knows: the files taken, and everything that follows from them. Its events are
 * `files`, `reading` and `extraction`; those of its score come from the score.
 */

import init, {
  FrameIndex,
  KeypointTable,
  Scoring,
  examine,
  joinFrames,
  temporalQuality,
} from "./pkg/index.js";
import { messageOf } from "./errors.js";
import { commandInputs } from "./files/command.js";
import {
  cameraOf,
  contentOf,
  entryOf,
  extractionOf,
  savedOf,
  tableOf,
  unread,
} from "./files/entry.js";
import { decodeImage } from "./files/image-cache.js";
import { identify, namedObjects } from "./files/intake.js";
import { Library } from "./files/library.js";
import { Problems, askForReading, readingKey } from "./files/problems.js";
import { applyRemedy, labelOf, remedyOf } from "./files/remedies.js";
import { REPLAY, readReplay } from "./files/replay.js";
import {
  LEAST_MARKED,
  markedText,
  repeatedText,
  replacedText,
  severalText,
  uselessText,
} from "./files/texts.js";
import { Points } from "./points.js";
import { judgeOf, previewOf } from "./preview.js";
import { Score } from "./score.js";
import { count } from "./ui/format.js";

/**
 * @typedef {import("./extraction/extractor.js").Extracted} Extracted
 * @typedef {import("./extraction/extractor.js").OpenEncoder} OpenEncoder
 * @typedef {import("./files/entry.js").Entry} Entry
 * @typedef {import("./files/entry.js").Slot} Slot
 * @typedef {import("./files/intake.js").Container} Container
 * @typedef {import("./files/intake.js").Found} Found
 * @typedef {import("./files/sources.js").Source} Source
 * @typedef {import("./pkg/index.js").Finding} Finding
 * @typedef {import("./pkg/index.js").GroundTruthTable} GroundTruthTable
 * @typedef {import("./pkg/index.js").JoinReport} JoinReport
 * @typedef {import("./pkg/index.js").MinConfidence} MinConfidence
 * @typedef {import("./pkg/index.js").Remedy} Remedy
 * @typedef {import("./pkg/index.js").SequenceRange} SequenceRange
 *
 * Fetches files that come with the page.
 * @typedef {(onProgress: (done: number, total: number) => void) => Promise<{ manifest: { title:
 * string, note?: string }, sources: Source[] }>} FetchSources
 *
 * Images in the order of an index.
 * @typedef {{ frames: FrameIndex, sources: Source[] }} Indexed
 */

/** Problems that are shown until more files are taken. */
const STICKY = ["nothing", "repeated", "replaced", "example", "views"];

/** The path of what is marked by hand. */
const MARKED = "marked.csv";

/** Milliseconds between two looks at the keypoints so far, and how many times one look takes. */
const PREVIEW = { least: 400, times: 12 };

/** What there is one used of, with what several of them are called. @type {[Slot, string][]} */
const SLOTS = [
  ["ground-truth", "ground-truth files"],
  ["checkpoint", "checkpoints"],
  ["keypoints", "keypoint tables"],
  ["camera", "cameras"],
  ["result", ""],
];

/** @type {Slot[]} */
const TABLES = ["ground-truth", "keypoints"];

export class Session extends EventTarget {
  problems = new Problems();
  score;
  library;
  /**
   * Files under way from the disk or the server; `total` is 0 while they are still being found.
   * @type {{ what: string, done: number, total: number } | null}
   */
  reading = null;
  /**
   * Where the data come from, when they are the example.
   * @type {{ title: string, note?: string } | null}
   */
  origin = null;
  /** Fetches the data of `origin` again. @type {FetchSources | null} */
  #fetchOrigin = null;
  /** The files of `origin`. @type {Source[]} */
  #originSources = [];

  /** Over all images. @type {FrameIndex | null} */
  frames = null;
  /** The images in the order of `frames`. @type {Source[]} */
  frameSources = [];
  /** Width and height of the first image, if known. @type {[number, number] | undefined} */
  frameSize = undefined;
  /** The size of images that are not here, by the user. @type {[number, number] | undefined} */
  saidSize = undefined;
  /** How sure points have to be to count, by the user. @type {MinConfidence} */
  minConfidence = {};
  /** Which of the points that are scored say how sure they are. */
  confident = { keypoints: false, truth: false };
  /** What a file of a saved score says of it. @type {import("./files/replay.js").Replay | null} */
  replay = null;
  /** @type {JoinReport | null} */
  join = null;
  /** What looks wrong and is to be answered before there is a score. @type {Finding[]} */
  questions = [];
  /** Whether the part that looks at the data is there. */
  #hasDoctor = false;
  /** Whether the part that scores points in space is there. */
  #hasSpace = false;
  /** Questions that were answered, in their words. @type {Set<string>} */
  #answered = new Set();
  /** The keypoints that are scored. @type {KeypointTable | null} */
  table = null;
  /**
   * A ground truth in space, put into the image by the camera.
   * @type {{ of: GroundTruthTable, table: GroundTruthTable } | null}
   */
  #projected = null;

  /** Changes are made one after the other. @type {Promise<void>} */
  #queue = Promise.resolve();
  /** Tells a change that everything was cleared while it waited. */
  #generation = 0;
  /** The user stopped the extraction: it goes on when asked to. */
  #paused = false;
  /** The frames done before the user stopped the extraction are scored without the others. */
  #isPartial = false;
  /** What was made from the files and is made anew when they change. @type {{ free(): void }[]} */
  #derived = [];
  /** What the preview was made of. @type {{ free(): void }[]} */
  #previewed = [];
  /** When the preview may be made anew. */
  #previewDue = 0;

  /**
   * @param {import("./extraction/extractor.js").Extractor} extractor
   * @param {{ remembers: boolean }} settings whether options outlast the page
   */
  constructor(extractor, settings) {
    super();
    this.score = new Score(this.problems, settings);
    this.library = new Library(extractor, () => this.#release());
  }

  /**
   * Makes changes wait for something that they need.
   * @param {Promise<void>} needed
   */
  hold(needed) {
    const settled = needed.catch((error) => this.problems.fail("views", error));
    this.#queue = this.#queue.then(() => settled);
  }

  // Files

  /**
   * Takes files: identifies each, parses it, and goes on with what is there then. They replace the
   * example, unless they are nothing but checkpoints, which are compared with its own.
   * @param {Source[] | Promise<Source[]>} sources
   */
  add(sources) {
    this.#read("Reading", 0, 0);
    return this.#change(async (alive) => {
      await this.#takeAll(await sources, alive, (found) => {
        if (!areCheckpoints(found)) this.#putAwayOrigin();
      });
    });
  }

  /**
   * Takes frames that were recorded here, with the keypoints that the checkpoint in use found.
   * @param {(Source & { extracted: Extracted })[]} recorded
   * @param {OpenEncoder} encoder of that checkpoint
   */
  addRecorded(recorded, encoder) {
    return this.#change(async (alive) => {
      const isKept = (/** @type {Entry} */ { taken }) => taken.role === "checkpoint";
      await this.#takeAll(recorded, alive, () => this.#putAwayOrigin(isKept));
      const entry = this.library.used("checkpoint");
      if (this.encoder !== encoder) return;
      for (const { path, extracted } of recorded) {
        extractionOf(entry)?.extracted.set(path, extracted);
      }
    });
  }

  /**
   * Replaces everything by files that are still to be fetched.
   * @param {FetchSources} fetchSources
   */
  async open(fetchSources) {
    this.clear();
    const generation = this.#generation;
    this.#fetchOrigin = fetchSources;
    // Files of the user's own that come meanwhile are preferred.
    const isWanted = () => generation === this.#generation && this.#fetchOrigin === fetchSources;
    try {
      const { manifest, sources } = await fetchSources((done, total) => {
        if (isWanted()) this.#read("Fetching", done, total);
      });
      await this.#change(async (alive) => {
        if (!isWanted()) return;
        this.origin = manifest;
        this.#originSources = sources;
        await this.#takeAll(sources, alive, () => {});
      });
    } catch (error) {
      if (!isWanted()) return;
      this.#fetchOrigin = null;
      this.reading = null;
      this.problems.report("fetch", "error", messageOf(error));
      this.emit("files");
    }
  }

  /**
   * Uses this file in place of the other one of its kind.
   * @param {Entry} entry
   */
  use(entry) {
    return this.#change(async () => this.library.prefer(entry));
  }

  /**
   * Takes a file for what the user says it is.
   * @param {Entry} entry
   * @param {Slot | "unknown"} role
   */
  setRole(entry, role) {
    return this.#change(async () => {
      entry.taken = { role, by: "said", reason: "as you said" };
      entry.wanted = true;
      this.library.reopen(entry);
    });
  }

  /**
   * Reads a table the way the user asks for.
   * @param {Entry} entry
   * @param {import("./pkg/index.js").TableOptions} options
   */
  setTableOptions(entry, options) {
    return this.#change(async () => {
      entry.options = { ...entry.options, ...options };
      entry.wanted ||= entry.parsed.state === "used";
      this.library.reopen(entry);
    });
  }

  /**
   * Runs an ONNX model the way the user says.
   * @param {Entry} entry
   * @param {import("./files/model-settings.js").Settings} said `undefined` takes back what was said
   */
  setModel(entry, said) {
    return this.#change(async () => {
      // When its turn comes: another answer may be on its way.
      const all = Object.entries({ ...entry.settings, ...said });
      const settings = Object.fromEntries(all.filter(([, value]) => value !== undefined));
      this.library.setModel(entry, settings);
    });
  }

  /**
   * Reads a table whose columns were renamed in a copy of it.
   * @param {Entry} entry
   * @param {"ground-truth" | "keypoints"} role
   * @param {Blob} blob
   */
  setColumns(entry, role, blob) {
    return this.#change(async () => {
      entry.source = { path: entry.path, blob };
      entry.isMapped = true;
      entry.taken = { role, by: "said", reason: "its columns as you said" };
      entry.wanted = true;
      this.library.reopen(entry);
    });
  }

  /**
   * Takes the positions that were marked by hand so far, in place of the earlier ones; `null` takes
   * them away.
   * @param {Blob | null} table
   * @param {number} frames that are marked
   */
  setMarks(table, frames) {
    return this.#change(async () => {
      const before = this.library.entries.find(({ path }) => path === MARKED);
      if (!table) {
        if (before) this.library.drop(before);
        return;
      }
      const taken = /** @type {const} */ ({ role: "ground-truth", by: "said" });
      const reason = `by hand: ${markedText(frames)}`;
      const source = { path: MARKED, blob: table };
      const entry = before ?? entryOf(source, { ...taken, reason });
      // What is said otherwise of another file at this path does not hold.
      const options = { space: /** @type {const} */ ("ndc"), indexBase: 0 };
      Object.assign(entry, { source, taken: { ...taken, reason }, options, alignment: {} });
      Object.assign(entry, { marked: frames, wanted: true });
      if (before) this.library.reopen(before);
      else this.library.entries.push(entry);
    });
  }

  /**
   * Changes what is added to the numbers of a ground truth.
   * @param {Entry} entry
   * @param {Entry["alignment"]} alignment
   */
  align(entry, alignment) {
    return this.#change(async () => {
      entry.alignment = { ...entry.alignment, ...alignment };
    });
  }

  /**
   * Puts right what looks wrong, or leaves it as it is.
   * @param {Finding} finding
   * @param {Remedy | null} remedy
   */
  answer(finding, remedy) {
    return this.#change(async () => {
      this.#answered.add(finding.text);
      if (remedy) applyRemedy(this.library, remedy);
    });
  }

  /**
   * Reads positions in pixels as those of images of this size, where there are no images that tell
   * it; `undefined` takes it back.
   * @param {[number, number] | undefined} size
   */
  setImageSize(size) {
    return this.#change(async () => {
      this.saidSize = size;
    });
  }

  /**
   * Scores the points that are at least this sure; `undefined` takes it back.
   * @param {MinConfidence} least
   */
  setMinConfidence(least) {
    return this.#change(async () => {
      this.minConfidence = { ...this.minConfidence, ...least };
    });
  }

  /** @param {Entry} entry */
  remove(entry) {
    return this.#change(async () => this.library.drop(entry));
  }

  /** Removes files that are not known for anything. */
  removeUnknown() {
    return this.#change(async () => {
      const isUnknown = (/** @type {Entry} */ { taken: { role, by } }) =>
        role === "unknown" && by !== "said";
      for (const entry of this.library.entries.filter(isUnknown)) this.library.drop(entry);
    });
  }

  removeImages() {
    return this.#change(async () => this.library.dropImages());
  }

  /** Removes the folders of runs. */
  removeRuns() {
    return this.#change(async () => this.library.runs.clear());
  }

  /**
   * Removes the images of a sequence.
   * @param {SequenceRange} sequence of `frames`
   */
  removeSequence(sequence) {
    const sources = this.#sourcesOf(sequence);
    return this.#change(async () => sources.forEach(({ path }) => this.library.dropImage(path)));
  }

  /**
   * Calls a sequence of images by another name.
   * @param {SequenceRange} sequence of `frames`
   * @param {string} name
   */
  renameSequence(sequence, name) {
    const sources = this.#sourcesOf(sequence);
    return this.#change(async () => {
      const moved = sources.map((source) => renamed(source.path, name));
      const taken = moved.find((path) => this.library.images.has(path));
      if (taken) throw new Error(`there is an image ${taken} already; choose another name`);
      sources.forEach((source, i) => this.library.moveImage(source, moved[i]));
    });
  }

  /** @param {SequenceRange} sequence of `frames` */
  #sourcesOf({ start, length }) {
    return this.frameSources.slice(start, start + length);
  }

  /**
   * Removes a file and all that lies in it.
   * @param {Container} container
   */
  removeContainer(container) {
    return this.#change(async () => this.library.dropContainer(container));
  }

  /**
   * Shows the frames of another camera of a recording.
   * @param {Container} container
   * @param {string} name
   */
  chooseCamera(container, name) {
    return this.#change(async (alive) => {
      const found = await container.cameras?.open(name);
      if (!found) return;
      if (!alive()) return giveBack(found);
      this.library.dropContainer(container);
      this.library.take(found);
    });
  }

  /**
   * Takes arrays of a recording as objects.
   * @param {Container} container
   * @param {string} columns which array is which object
   * @param {import("./pkg/index.js").TableOptions} options their unit
   * @throws {Error} where there are no such arrays
   */
  async nameObjects(container, columns, options) {
    const entry = await namedObjects(container, columns, options);
    if (!entry) return;
    await this.#change(async () => {
      this.library.takeNamed(entry);
    });
  }

  /** Back to the state of a fresh page. */
  clear() {
    this.#generation++;
    this.#empty();
    this.score.resetOptions();
    this.emit("files");
    this.emit("extraction");
    this.score.emit("scoring");
  }

  /**
   * Puts away why a file cannot be used.
   * @param {string} path
   */
  dismissError(path) {
    this.library.dismissError(path);
    this.emit("files");
  }

  /**
   * The ground truth, in the image where a camera puts it there.
   * @returns {GroundTruthTable | null}
   */
  get truth() {
    const content = contentOf(this.library.used("ground-truth"));
    if (content?.kind !== "ground-truth") return null;
    const projected = this.#projected;
    return projected?.of === content.table ? projected.table : content.table;
  }

  /** Frames that are marked by hand, where that is the ground truth. */
  get marked() {
    return this.library.used("ground-truth")?.marked ?? null;
  }

  /** Whether more frames have to be marked by hand before there is a score. */
  get lacksMarks() {
    return this.marked !== null && this.marked < LEAST_MARKED;
  }

  /** What is added to the numbers of the ground truth. */
  get alignment() {
    return this.library.used("ground-truth")?.alignment ?? {};
  }

  /** @returns {OpenEncoder | null} */
  get encoder() {
    const content = contentOf(this.library.used("checkpoint"));
    return content?.kind === "checkpoint" ? content.encoder : null;
  }

  /**
   * What a score needs, whether it is there, and the files that would be it if they could be used.
   * @returns {{ label: string, met: boolean, broken: Entry[] }[]}
   */
  get needs() {
    const { library } = this;
    const keypoints = library.used("keypoints");
    // A saved evaluation is a score.
    const isAlone = !this.truth && !this.frames && !this.encoder && !keypoints;
    if (library.used("result") && isAlone) return [];
    const need = (
      /** @type {string} */ label,
      /** @type {boolean} */ met,
      /** @type {Slot[]} */ ...roles
    ) => {
      const isBroken = (/** @type {Entry} */ { parsed, taken }) =>
        parsed.state === "broken" && roles.some((role) => role === taken.role);
      return { label, met, broken: met ? [] : library.entries.filter(isBroken) };
    };
    const label =
      this.marked === null ? "ground truth" : `ground truth: ${markedText(this.marked)}`;
    const truth = need(label, this.truth !== null && !this.lacksMarks, "ground-truth");
    if (keypoints) return [need("keypoints", true), truth];
    const images = need("image sequences", this.frames !== null);
    const detector = this.encoder !== null;
    return [images, truth, need("checkpoint (or keypoints)", detector, "checkpoint", "keypoints")];
  }

  /**
   * Whether a file is a detector that can be scored on what is here, and so is compared with the
   * others.
   * @param {Entry} entry
   */
  isCompared(entry) {
    const content = contentOf(entry);
    if (!this.truth || this.lacksMarks || !content) return false;
    return content.kind === "keypoints" || (content.kind === "checkpoint" && this.frames !== null);
  }

  // Extraction

  /** The extraction with the checkpoint in use, when its keypoints are the ones wanted. */
  get extraction() {
    return this.library.used("keypoints") ? null : extractionOf(this.library.used("checkpoint"));
  }

  /** Starts the extraction, or goes on with it. */
  extract() {
    this.#paused = false;
    this.#isPartial = false;
    return this.#run();
  }

  /** Stops the extraction at once; the frames done are kept. */
  cancel() {
    this.#paused = true;
    this.extraction?.stop("cancelled");
    this.emit("extraction");
  }

  /** Scores the frames that are done, after the extraction was cancelled. */
  scorePartially() {
    this.#isPartial = true;
    return this.#change(async () => {});
  }

  // What follows from what

  /**
   * Makes a change after those under way, and what follows from it.
   * @param {(alive: () => boolean) => Promise<void>} change
   */
  #change(change) {
    const generation = this.#generation;
    const alive = () => generation === this.#generation;
    const made = this.#queue.then(async () => {
      if (!alive()) return;
      try {
        await change(alive);
        if (alive()) await this.#settle(alive);
      } catch (error) {
        if (alive()) this.problems.fail("unexpected", error);
      }
      if (!alive()) return;
      this.reading = null;
      this.emit("files");
    });
    this.#queue = made;
    return made;
  }

  /**
   * @param {Source[]} sources
   * @param {() => boolean} alive
   * @param {(found: Found) => void} prepare is called before files of any use are taken
   */
  async #takeAll(sources, alive, prepare) {
    const { problems } = this;
    for (const key of STICKY) problems.delete(key);
    if (sources.length === 0) {
      problems.report("nothing", "error", "There was no file in what was dropped.");
      return;
    }
    const found = await identify(
      sources,
      (done, total) => alive() && this.#read("Reading", done, total),
    );
    if (!alive()) return giveBack(found);
    this.reading = null;
    await this.#takeReplay(found);
    const isUseless = isNothing(found);
    if (!isUseless) prepare(found);
    const { repeated, replaced } = this.library.take(found);
    if (repeated.length > 0) problems.report("repeated", "warning", repeatedText(repeated));
    if (replaced.size > 0) this.#offerReplaced([...replaced.values()]);
    if (isUseless) problems.report("nothing", "error", uselessText(sources.length));
  }

  /**
   * Takes the settings of a score that was saved with its files.
   * @param {Found} found
   */
  async #takeReplay(found) {
    const entry = found.entries.find(({ path }) => path.split("/").pop() === REPLAY);
    const replay = entry ? await readReplay(entry.source) : null;
    if (!entry || !replay) return;
    found.entries = found.entries.filter((other) => other !== entry);
    for (const { taken, options } of found.entries) {
      if (taken.role === "ground-truth") Object.assign(options, replay.truth);
      if (taken.role === "keypoints") Object.assign(options, replay.keypoints);
    }
    this.replay = replay;
    this.minConfidence = replay.minConfidence ?? {};
    this.score.takeOptions(replay);
  }

  /** @param {Source[]} images that others replaced */
  #offerReplaced(images) {
    const restore = () =>
      this.#change(async () => {
        this.problems.delete("replaced");
        for (const image of images) this.library.takeImage(image);
      });
    const text = replacedText(images.map(({ path }) => path));
    this.problems.report("replaced", "warning", text, {
      label: "Use the earlier ones again",
      run: () => void restore(),
    });
  }

  /**
   * Takes the example away for files of the user's own, and says so.
   * @param {(entry: Entry) => boolean} [isKept] of what stays
   */
  #putAwayOrigin(isKept = () => false) {
    const fetchSources = this.#fetchOrigin;
    if (!fetchSources) return;
    const blobs = new Set(this.#originSources.map((source) => "blob" in source && source.blob));
    const isOrigin = (/** @type {Source} */ source) => "blob" in source && blobs.has(source.blob);
    const { entries, images } = this.library;
    // What was dropped on the example and is of no use goes with it.
    const isGone = (/** @type {Entry} */ { source, taken }) =>
      isOrigin(source) || taken.role === "unknown";
    for (const entry of entries) if (isGone(entry) && !isKept(entry)) this.library.drop(entry);
    for (const image of [...images.values()].filter(isOrigin)) this.library.dropImage(image.path);
    this.#forgetOrigin();
    this.problems.report("example", "info", "Your files took the place of the example.", {
      label: "Load the example again",
      run: () => void this.open(fetchSources),
    });
  }

  #forgetOrigin() {
    this.origin = null;
    this.#fetchOrigin = null;
    this.#originSources = [];
    this.#paused = false;
    this.#isPartial = false;
  }

  /** Gives everything back. */
  #empty() {
    this.#release();
    this.library.clear();
    this.frames?.free();
    this.#projected?.table.free();
    this.#projected = null;
    this.problems.clear();
    this.#answered.clear();
    this.reading = null;
    this.frameSize = undefined;
    this.saidSize = undefined;
    this.minConfidence = {};
    this.replay = null;
    this.frames = null;
    this.frameSources = [];
    this.join = null;
    this.#forgetOrigin();
  }

  /** @param {() => boolean} alive */
  async #settle(alive) {
    for (const entry of this.library.entries) extractionOf(entry)?.stop("idle");
    this.problems.settle(STICKY);
    await this.#indexFrames();
    await this.#parseEntries(alive);
    if (!alive()) return;
    for (const [role, many] of SLOTS) this.#assign(role, many);
    for (const role of TABLES) this.#checkReading(this.library.used(role));
    this.#project();
    this.#joinFrames();
    this.emit("files");
    await this.#loadDoctor();
    if (alive()) this.#advance();
  }

  async #indexFrames() {
    this.frames?.free();
    this.frames = null;
    const images = [...this.library.images.values()];
    try {
      if (images.length > 0) this.frames = FrameIndex.ofAll(images.map(({ path }) => path));
    } catch (error) {
      // E.g. a copy of an image next to its original: it is not clear which rows they belong to.
      this.problems.report("frames", "error", messageOf(error), {
        label: "Remove the images",
        run: () => void this.removeImages(),
      });
    }
    const first = this.frameSources[0];
    this.frameSources = Array.from(this.frames?.order ?? [], (position) => images[position]);
    if (this.frameSources[0] !== first) {
      // The images of a saved score are small ones.
      this.frameSize = this.replay?.imageSize ?? (await sizeOf(this.frameSources[0]));
    }
  }

  /**
   * Parses what is new, and the tables in pixels when the images have another size.
   * @param {() => boolean} alive
   */
  async #parseEntries(alive) {
    const isCamera = (/** @type {Entry} */ { taken }) => taken.role === "camera";
    const cameras = this.library.pending(undefined).filter(isCamera);
    if (cameras.length > 0) await this.#enterSpace();
    // A camera may say the size that tables in pixels need.
    await this.#parseAll(cameras, alive);
    if (alive()) await this.#parseAll(this.library.pending(this.#knownSize), alive);
    if (!alive() || !this.library.isInSpace) return;
    await this.#enterSpace();
    await this.#parseAll(this.library.pending(this.#knownSize), alive);
  }

  /** Loads the part that scores points in space, for which all that was read is read again. */
  async #enterSpace() {
    if (this.#hasSpace) return;
    await init(["space"]).catch((error) => {
      throw new Error(
        `Points in space need a part of the page that is not there: ${messageOf(error)}`,
      );
    });
    this.#hasSpace = true;
    this.#release();
    await this.library.reopenAll();
    await this.#indexFrames();
  }

  /**
   * @param {Entry[]} pending
   * @param {() => boolean} alive
   */
  async #parseAll(pending, alive) {
    if (pending.length === 0) return;
    this.#release();
    for (const [i, entry] of pending.entries()) {
      if (pending.length > 1) this.#read("Reading", i, pending.length);
      await this.library.parse(entry, this.#knownSize);
      if (!alive()) {
        unread(entry);
        return;
      }
    }
    this.reading = null;
  }

  /**
   * Width and height of the images: theirs, as the user says, or as a camera does.
   * @returns {[number, number] | undefined}
   */
  get #knownSize() {
    const camera = cameraOf(
      this.library.used("camera") ?? this.library.usable("camera")[0] ?? null,
    );
    return this.frameSize ?? this.saidSize ?? camera?.imageSize;
  }

  /**
   * Decides which file of a kind is used: the one the user chose, or the first.
   * @param {Slot} role
   * @param {string} many what to call several of them; empty where any number is shown
   */
  #assign(role, many) {
    const candidates = this.library.usable(role);
    if (candidates.length === 0) return;
    const used = this.library.used(role) ?? candidates[0];
    this.library.prefer(used);
    const others = candidates.filter((entry) => entry !== used);
    const [spare] = others;
    if (!spare || !many) return;
    const areCompared = this.isCompared(spare);
    const condition = role === "checkpoint" ? ", each once its keypoints are extracted" : "";
    const paths = [used, ...others].map(({ path }) => path);
    const text = severalText(many, paths, { areCompared, condition });
    this.problems.offer(`several-${role}`, areCompared ? "info" : "warning", text, {
      label: `${areCompared ? "Show" : "Use"} ${spare.path} instead`,
      run: () => void this.use(spare),
    });
  }

  /** @param {Entry | null} entry the table in use */
  #checkReading(entry) {
    const reasons = tableOf(entry)?.reasons;
    if (!entry || !reasons) return;
    const read = (/** @type {import("./pkg/index.js").TableOptions} */ options) =>
      void this.setTableOptions(entry, options);
    askForReading(this.problems, entry.path, reasons, read);
  }

  /** Puts a ground truth in space into the image, where there is a camera. */
  #project() {
    this.#projected?.table.free();
    this.#projected = null;
    const { truth } = this;
    const entry = this.library.used("camera");
    const camera = cameraOf(entry);
    if (!truth || !entry || !camera) return;
    if (truth.axes === 2) {
      const text =
        `${entry.path} is not used: the ground truth has two coordinates, and a camera projects ` +
        "three.";
      this.problems.offer("camera", "info", text);
      return;
    }
    this.#projected = { of: truth, table: truth.projected(camera) };
  }

  #joinFrames() {
    this.join = null;
    if (!this.frames || !this.truth || this.library.used("keypoints")) return;
    try {
      this.join = joinFrames(this.frames, this.truth, this.alignment);
    } catch (error) {
      this.#failToJoin("join", error);
    }
  }

  /**
   * @param {string} key
   * @param {unknown} error of frames that match no row
   */
  #failToJoin(key, error) {
    const remedy = remedyOf(error);
    const run = () =>
      void this.#change(async () => applyRemedy(this.library, /** @type {Remedy} */ (remedy)));
    const action = remedy ? { label: labelOf(remedy), run } : undefined;
    this.problems.report(key, "error", messageOf(error), action);
  }

  /** From keypoints to a score, or to the extraction that is needed first. */
  #advance() {
    this.#release();
    const indexed = this.#collectKeypoints();
    const isEnough = !this.lacksMarks;
    if (this.table && this.truth && isEnough) this.#scoreTable(this.truth, this.table, indexed);
    if (!this.score.scoring) this.#showSaved();
    this.score.emit("scoring");
    this.#showPreview();
    this.emit("extraction");
    const isReady = this.join && !this.#paused && this.extraction?.status !== "failed";
    if (!this.table && isReady) void this.#run();
  }

  /**
   * Sets the table of keypoints, if they are there, and returns the images they belong to.
   * @returns {Indexed | null}
   */
  #collectKeypoints() {
    const given = contentOf(this.library.used("keypoints"));
    const all = this.frames ? { frames: this.frames, sources: this.frameSources } : null;
    if (given?.kind === "keypoints") {
      this.table = given.table;
      return all;
    }
    const { extraction } = this;
    if (!all || !extraction) return null;
    const isComplete = extraction.pending(this.frameSources).length === 0;
    if (!isComplete && !(this.#isPartial && extraction.status !== "running")) return null;
    const found = extraction.collect(all.frames, all.sources);
    if (!found) {
      const [first] = extraction.failures.values();
      const frames = count(this.frameSources.length, "frame");
      this.problems.report("frames", "error", `None of the ${frames} has keypoints: ${first}`);
      return null;
    }
    if (found.selected) this.#derived.push(found.selected);
    this.#derived.push(found.table);
    this.table = found.table;
    return { frames: found.selected ?? all.frames, sources: found.sources };
  }

  /**
   * @param {GroundTruthTable} truth
   * @param {KeypointTable} table
   * @param {Indexed | null} indexed
   */
  #scoreTable(truth, table, indexed) {
    const least = this.#leastConfidence(truth, table);
    /** @type {Scoring} */
    let scoring;
    try {
      scoring = new Scoring(truth, table, undefined, least, this.alignment);
    } catch (error) {
      this.#failToJoin("scoring", error);
      return;
    }
    this.#derived.push(scoring);
    this.join = scoring.join;
    const findings = this.#examine(truth, table, least);
    if (this.questions.length > 0) return;
    const positions = indexed ? Array.from(scoring.imagesFrom(indexed.frames)) : [];
    const pictures = positions.map((at) => (at < 0 ? null : (indexed?.sources[at] ?? null)));
    const { sequences, frameNumbers } = scoring;
    const sizes = this.#measure(pictures);
    if (this.#lacksCommonSize(truth, sizes)) return;
    const config = this.encoder ? this.encoder.info.config : (this.replay?.config ?? null);
    const parts = { scoring, sequences, frameNumbers, pictures, sizes, config };
    const inputs = commandInputs(this.library, this.frameSources);
    this.score.show(new Points(parts), inputs, findings);
  }

  /**
   * Whether positions are in pixels of frames of several sizes, which is told then. COCO files have
   * the size of every image.
   * @param {GroundTruthTable} truth
   * @param {[number, number][]} sizes of the frames; one where it is that of all
   */
  #lacksCommonSize({ reading }, sizes) {
    const [[width, height] = [], ...others] = sizes;
    const other = others.find(([w, h]) => w !== width || h !== height);
    if (!other || reading.space.value !== "px" || reading.layout === "COCO keypoints") return false;
    if (this.library.used("ground-truth")?.options.imageSize) return false;
    const text =
      `The frames have several sizes (${width} x ${height} and ${other[0]} x ${other[1]} pixels), so ` +
      "that positions in pixels have no common size. Give them as fractions of their own image, " +
      "or scale the frames to one size.";
    this.problems.report("scoring", "error", text);
    return true;
  }

  /** Loads what looks at the data before a score; the frames are there meanwhile. */
  async #loadDoctor() {
    if (!this.truth || this.#hasDoctor) return;
    this.#showPreview();
    try {
      await init(["doctor"]);
      this.#hasDoctor = true;
    } catch (error) {
      const text = `The data cannot be checked before it is scored: ${messageOf(error)}`;
      this.problems.report("doctor", "warning", text);
    }
  }

  /**
   * What looks wrong with two tables; what can be put right becomes a question.
   * @param {GroundTruthTable} truth
   * @param {KeypointTable} table
   * @param {MinConfidence} least
   */
  #examine(truth, table, least) {
    if (!this.#hasDoctor) return [];
    const findings = examine(truth.toObject(), table.toObject(), least, this.alignment);
    this.questions = findings.filter(
      ({ text, remedies }) => remedies.length > 0 && !this.#answered.has(text),
    );
    this.#settleReadings();
    return findings;
  }

  /**
   * How good the best keypoints are over time; `null` where there is only a saved evaluation, and it
   * does not say.
   */
  async temporalQuality() {
    await init(["temporal"]);
    const { truth, table } = this;
    return this.score.measure((options) => {
      if (!truth || !table) return null;
      const least = this.#leastConfidence(truth, table);
      return temporalQuality(truth.toObject(), table.toObject(), least, this.alignment, options);
    });
  }

  /** Takes back what was asked about the unit of a table that now has a question of its own. */
  #settleReadings() {
    for (const { remedies } of this.questions) {
      const [remedy] = remedies;
      if (remedy?.type !== "unit") continue;
      const of = remedy.side === "truth" ? "ground-truth" : "keypoints";
      const entry = this.library.used(of);
      if (entry) this.problems.delete(readingKey(entry.path));
    }
  }

  /** Shows the frames with what is known of them, until there is a score. */
  #showPreview() {
    const { score } = this;
    const before = this.#previewed;
    this.#previewed = [];
    const start = performance.now();
    const isNeeded = !score.scoring && !score.saved;
    // No number before the questions are answered and enough is marked.
    const isOpen = this.questions.length > 0 || this.lacksMarks;
    const provisional = isNeeded && !isOpen ? this.#judgeSoFar() : null;
    score.showPreview(isNeeded ? previewOf(this, this.#previewed) : null, provisional);
    // The views have let go of it now.
    for (const made of before.reverse()) made.free();
    const { least, times } = PREVIEW;
    const now = performance.now();
    this.#previewDue = now + Math.max(least, times * (now - start));
  }

  /** What the frames that have keypoints already come to; gives back what it took for that. */
  #judgeSoFar() {
    /** @type {{ free(): void }[]} */
    const made = [];
    try {
      const scoring = judgeOf(this, made);
      return scoring && this.score.evaluateSoFar(scoring);
    } finally {
      for (const one of made.reverse()) one.free();
    }
  }

  /**
   * The smallest confidences, of tables that have any.
   * @param {GroundTruthTable} truth
   * @param {KeypointTable} table
   * @returns {MinConfidence}
   */
  #leastConfidence(truth, table) {
    this.confident = { keypoints: table.hasConfidence, truth: truth.hasConfidence };
    const { keypoints, truth: positions } = this.minConfidence;
    return {
      ...(table.hasConfidence && keypoints !== undefined ? { keypoints } : {}),
      ...(truth.hasConfidence && positions !== undefined ? { truth: positions } : {}),
    };
  }

  /** Shows an evaluation that was saved, unless a score is about to come. */
  #showSaved() {
    const entry = this.library.used("result");
    const evaluation = savedOf(entry);
    const { extraction } = this;
    const isComing =
      this.join !== null && extraction !== null && !this.#paused && extraction.status !== "failed";
    if (entry && evaluation && !isComing) this.score.showSaved({ path: entry.path, evaluation });
  }

  /**
   * The sizes of the joined images: from the extraction, otherwise from the first image.
   * @param {(Source | null)[]} pictures
   * @returns {[number, number][]}
   */
  #measure(pictures) {
    const extracted = this.extraction?.extracted;
    if (extracted) {
      /** @type {[number, number][]} */
      const sizes = pictures.map((picture) => {
        const { width = 0, height = 0 } = (picture && extracted.get(picture.path)) || {};
        return [width, height];
      });
      const [first] = sizes;
      return sizes.every(([w, h]) => w === first[0] && h === first[1]) ? sizes.slice(0, 1) : sizes;
    }
    // The viewer reports an image that cannot be decoded when it comes to it; errors in pixels are
    // left out then.
    const hasPictures = pictures.some((picture) => picture !== null);
    const size = hasPictures ? this.frameSize : this.#knownSize;
    return size ? [size] : [];
  }

  async #run() {
    const { extraction } = this;
    if (!extraction || extraction.status === "running") return;
    if (extraction.pending(this.frameSources).length === 0) return;
    const generation = this.#generation;
    const alive = () => generation === this.#generation && this.extraction === extraction;
    const running = extraction.run(this.frameSources, () => {
      if (alive() && performance.now() >= this.#previewDue) this.#showPreview();
      this.emit("extraction");
    });
    this.emit("extraction");
    const complete = await running;
    if (!alive()) return;
    if (!complete) this.#showPreview();
    this.emit("extraction");
    if (!complete) return;
    this.#queue = this.#queue.then(async () => {
      // Another change may have come first; it has settled everything then.
      if (alive() && extraction.status === "idle") this.#advance();
      this.emit("files");
    });
  }

  /** Gives back what was derived from the files. */
  #release() {
    this.score.forget();
    for (const made of [...this.#derived, ...this.#previewed].reverse()) made.free();
    this.#derived = [];
    this.#previewed = [];
    this.questions = [];
    this.table = null;
  }

  /**
   * @param {string} what
   * @param {number} done
   * @param {number} total
   */
  #read(what, done, total) {
    this.reading = { what, done, total };
    this.emit("reading");
  }

  /** @param {string} topic */
  emit(topic) {
    this.dispatchEvent(new Event(topic));
  }
}

/**
 * Gives back what files hold that are not taken.
 * @param {Found} found
 */
function giveBack({ entries, containers }) {
  for (const { arrays } of entries) arrays?.free();
  for (const container of containers) container.close();
}

/**
 * Whether there is neither anything of use in files, nor anything that would be if it could be
 * read.
 * @param {Found} found
 */
function isNothing({ images, runs, entries, containers }) {
  const isUseless = entries.every(
    ({ taken, parsed }) => taken.role === "unknown" && parsed.state !== "broken",
  );
  const areReadable = containers.every(({ error }) => error === "");
  return images.length + runs.size === 0 && isUseless && areReadable;
}

/**
 * Whether files are checkpoints and nothing else.
 * @param {Found} found
 */
function areCheckpoints({ images, runs, entries }) {
  const isCheckpoint = (/** @type {Entry} */ { taken: { role } }) => role === "checkpoint";
  return images.length + runs.size === 0 && entries.length > 0 && entries.every(isCheckpoint);
}

/**
 * Width and height of an image; one that cannot be read is reported when its keypoints are
 * extracted.
 * @param {Source | undefined} source
 * @returns {Promise<[number, number] | undefined>}
 */
async function sizeOf(source) {
  try {
    const image = source && (await decodeImage(source));
    if (!image) return undefined;
    const { width, height } = image;
    image.close();
    return [width, height];
  } catch {
    return undefined;
  }
}

/**
 * The path of an image in a sequence of another name.
 * @param {string} path
 * @param {string} name
 */
function renamed(path, name) {
  const parts = path.split("/");
  return [...parts.slice(0, -2), name, parts[parts.length - 1]].join("/");
}
