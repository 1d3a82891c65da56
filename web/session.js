// @ts-check
/**
 * What the page knows: the files taken, and everything that follows from them. Beside those of a
 * score, its events are `files`, `reading` and `extraction`.
 */

import { FrameIndex, KeypointTable, Scoring, joinFrames } from "./pkg/index.js";
import { kindOf, messageOf } from "./errors.js";
import { Extraction } from "./extraction/extraction.js";
import { blobOf, readError } from "./files/sources.js";
import { count, names } from "./ui/format.js";
import { decodeImage } from "./files/image-cache.js";
import { identify, isReadWithSize, isTable, needsParsing, parseTable } from "./files/intake.js";
import { SavedEvaluation } from "./files/saved.js";
import { Score } from "./score.js";

/**
 * @typedef {import("./extraction/extractor.js").OpenEncoder} OpenEncoder
 * @typedef {import("./files/sources.js").Source} Source
 * @typedef {import("./files/intake.js").Container} Container
 * @typedef {import("./files/intake.js").Entry} Entry
 * @typedef {import("./files/intake.js").Slot} Slot
 * @typedef {import("./pkg/index.js").GroundTruthTable} GroundTruthTable
 * @typedef {import("./pkg/index.js").JoinReport} JoinReport
 * @typedef {import("./pkg/index.js").SequenceRange} SequenceRange
 *
 * Fetches files that come with the page.
 * @typedef {(onProgress: (done: number, total: number) => void) => Promise<{ manifest: { title:
 * string, note?: string },
 *   sources: Source[] }>} FetchSources
 */

/** What stays said until more files are taken. */
const STICKY = ["nothing", "repeated", "replaced", "example"];

const LACKS_SIZE =
  "its positions are in pixels, and the size of the images is not known. Enter it at the file in " +
  "the list, or add the images; " +
  "or choose ndc there, if that is their unit.";

/**
 * What there is one used of, with what several of them are called; of results any number is shown.
 * @type {[Slot, string | null][]}
 */
const SLOTS = [
  ["ground-truth", "ground-truth files"],
  ["checkpoint", "checkpoints"],
  ["keypoints", "keypoint tables"],
  ["result", null],
];

export class Session extends Score {
  /**
   * Files under way from the disk or the server.
   * @type {{ what: string, done: number, total: number } | null}
   */
  reading = null;
  /** @type {Entry[]} */
  entries = [];
  /** Images by path. @type {Map<string, Source>} */
  images = new Map();
  /** The files that held others. @type {Container[]} */
  containers = [];
  /** Folders of runs by path. @type {Map<string, import("./files/runs.js").RunFolder>} */
  runs = new Map();
  /**
   * Where the data come from, when they are the example.
   * @type {{ title: string, note?: string } | null}
   */
  origin = null;
  /** Fetches the data again that `origin` tells of. @type {FetchSources | null} */
  #fetchOrigin = null;

  /** Over all images. @type {FrameIndex | null} */
  frames = null;
  /** The images in the order of `frames`. @type {Source[]} */
  frameSources = [];
  /**
   * Width and height of the first image, when it can be decoded.
   * @type {[number, number] | undefined}
   */
  frameSize = undefined;
  /**
   * What the user says of the size of images that are not here.
   * @type {[number, number] | undefined}
   */
  saidSize = undefined;
  /** @type {JoinReport | null} */
  join = null;

  /** The keypoints that are scored. @type {KeypointTable | null} */
  table = null;

  #extractor;
  /** Changes are made one after the other. @type {Promise<void>} */
  #queue = Promise.resolve();
  /** Tells a change that everything was cleared while it waited. */
  #generation = 0;
  /** The user stopped the extraction: it goes on when asked to. */
  #paused = false;
  #excludeNonFinite = false;
  /** Choices between files that the user has seen and put away, by text. @type {Set<string>} */
  #dismissed = new Set();
  /** What was made from the files and is made anew when they change. @type {{ free(): void }[]} */
  #derived = [];

  /**
   * @param {import("./extraction/extractor.js").Extractor} extractor
   * @param {{ remembers: boolean }} settings whether options outlast the page
   */
  constructor(extractor, { remembers }) {
    super(remembers);
    this.#extractor = extractor;
  }

  // Files

  /**
   * Takes files: says what each is, parses it, and goes on with what is there then. They take the
   * place of the example.
   * @param {Source[]} sources
   */
  add(sources) {
    return this.#change((alive) => this.#takeAll(sources, alive, () => this.#putAwayOrigin()));
  }

  /**
   * @param {Source[]} sources
   * @param {() => boolean} alive
   * @param {() => void} prepare is called before the files are taken, if any of them is of use
   */
  async #takeAll(sources, alive, prepare) {
    for (const key of STICKY) this.problems.delete(key);
    if (sources.length === 0) {
      this.report("nothing", "error", "There was no file in what was dropped.");
      return;
    }
    const found = await identify(
      sources,
      (done, total) => alive() && this.#read("Reading", done, total),
    );
    if (!alive()) {
      for (const { arrays } of found.entries) arrays?.free();
      return;
    }
    this.reading = null;
    const isUseless = isNothing(found);
    if (!isUseless) prepare();
    /** @type {Map<string, Source>} */
    const replaced = new Map();
    for (const container of found.containers) {
      for (const image of this.#emptied(container)) replaced.set(image.path, image);
      this.containers.push(container);
    }
    for (const [path, run] of found.runs) this.runs.set(path, run);
    /** @type {Set<string>} */
    const taken = new Set();
    const repeated = [];
    for (const image of found.images) {
      if (taken.has(image.path)) {
        repeated.push(image.path);
        continue;
      }
      taken.add(image.path);
      const before = this.images.get(image.path);
      if (before && isSame(before, image)) continue;
      if (before) replaced.set(image.path, before);
      this.#takeImage(image);
    }
    for (const entry of found.entries) {
      if (taken.has(entry.path)) {
        repeated.push(entry.path);
        entry.arrays?.free();
        continue;
      }
      taken.add(entry.path);
      this.#take(entry);
    }
    this.#tellRepeated(repeated);
    this.#tellReplaced(replaced);
    if (isUseless) {
      const what =
        sources.length === 1 ? "The file is" : `None of the ${count(sources.length, "file")} is`;
      this.report(
        "nothing",
        "error",
        `${what}${sources.length === 1 ? " not" : ""} an image, a table, a checkpoint or a ` +
          "result. Expected PNG, JPEG or WebP " +
          "images, a recording (.npz), a CSV or JSON table of object positions or keypoints, a " +
          "checkpoint " +
          "(.safetensors, .pth or .bpk), a saved evaluation (.json), or a .zip archive of these.",
      );
    }
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
        await this.#takeAll(sources, alive, () => {});
      });
    } catch (error) {
      if (!isWanted()) return;
      this.#fetchOrigin = null;
      this.reading = null;
      this.report("fetch", "error", messageOf(error));
      this.emit("files");
    }
  }

  /**
   * Uses this file in place of the other one of its kind.
   * @param {Entry} entry
   */
  use(entry) {
    return this.#change(async () => this.#prefer(entry));
  }

  /**
   * Takes a file for what the user says it is.
   * @param {Entry} entry
   * @param {Entry["role"]} role
   */
  setRole(entry, role) {
    return this.#change(async () => {
      Object.assign(entry, {
        role,
        isSaid: true,
        isGuess: false,
        reason: "as you said",
        wanted: true,
      });
      this.#reopen(entry);
    });
  }

  /**
   * Reads a table with what the user says of its numbers.
   * @param {Entry} entry
   * @param {import("./pkg/index.js").TableOptions} options
   */
  setTableOptions(entry, options) {
    return this.#change(async () => {
      Object.assign(entry, {
        options: { ...entry.options, ...options },
        wanted: entry.state === "used" || entry.wanted,
      });
      this.#reopen(entry);
    });
  }

  /**
   * Reads positions in pixels as those of images of this size, where there are no images that tell
   * it; `undefined` takes back what was said.
   * @param {[number, number] | undefined} size
   */
  setImageSize(size) {
    return this.#change(async () => {
      this.saidSize = size;
    });
  }

  /** @param {Entry} entry */
  remove(entry) {
    return this.#change(async () => this.#drop(entry));
  }

  /** Removes files that are not known for anything. */
  removeUnknown() {
    return this.#change(async () => {
      for (const entry of this.entries.filter(({ role, isSaid }) => role === "unknown" && !isSaid))
        this.#drop(entry);
    });
  }

  removeImages() {
    return this.#change(async () => {
      this.images.clear();
      for (const { extraction } of this.entries) {
        extraction?.extracted.clear();
        extraction?.failures.clear();
      }
    });
  }

  /** Removes the folders of runs. */
  removeRuns() {
    return this.#change(async () => this.runs.clear());
  }

  /**
   * Removes the images of a sequence.
   * @param {SequenceRange} sequence of `frames`
   */
  removeSequence({ start, length }) {
    const sources = this.frameSources.slice(start, start + length);
    return this.#change(async () => sources.forEach((source) => this.#dropImage(source.path)));
  }

  /**
   * Removes a file and all that lies in it.
   * @param {Container} container
   */
  removeContainer(container) {
    return this.#change(async () => {
      this.#emptied(container);
      const isInside = insideOf(container);
      for (const entry of this.entries.filter(isInside)) this.#drop(entry);
    });
  }

  /** Back to the state of a fresh page. */
  clear() {
    this.#generation++;
    this.#empty();
    this.resetOptions();
    for (const topic of ["files", "extraction", "scoring"]) this.emit(topic);
  }

  /** Takes the example away for files of the user's own, and says so. */
  #putAwayOrigin() {
    const fetchSources = this.#fetchOrigin;
    if (!fetchSources) return;
    this.#empty();
    this.report("example", "info", "Your files took the place of the example.", {
      label: "Load the example again",
      run: () => void this.open(fetchSources),
    });
  }

  /** Gives everything back. */
  #empty() {
    this.extraction?.stop("idle");
    this.#release();
    for (const entry of this.entries) {
      entry.content?.free();
      entry.arrays?.free();
    }
    this.frames?.free();
    this.reading = null;
    this.entries = [];
    this.images = new Map();
    this.containers = [];
    this.runs = new Map();
    this.frameSize = undefined;
    this.saidSize = undefined;
    this.problems = new Map();
    this.origin = null;
    this.#fetchOrigin = null;
    this.frames = null;
    this.frameSources = [];
    this.join = null;
    this.#paused = false;
    this.#excludeNonFinite = false;
    this.#dismissed.clear();
  }

  /**
   * Puts a problem away.
   * @param {string} key
   */
  dismiss(key) {
    const problem = this.problems.get(key);
    if (problem) this.#dismissed.add(problem.text);
    this.problems.delete(key);
    this.emit("files");
  }

  /**
   * The file that is used as this.
   * @param {Slot} role
   */
  used(role) {
    return this.entries.find((entry) => entry.role === role && entry.state === "used") ?? null;
  }

  /** @returns {GroundTruthTable | null} */
  get truth() {
    return /** @type {GroundTruthTable | null} */ (this.used("ground-truth")?.content ?? null);
  }

  /** @returns {OpenEncoder | null} */
  get encoder() {
    return /** @type {OpenEncoder | null} */ (this.used("checkpoint")?.content ?? null);
  }

  /**
   * What a score needs, whether it is there, and the files that would be it if they could be used.
   * @returns {{ label: string, met: boolean, broken: Entry[] }[]}
   */
  get needs() {
    const parts = [this.truth, this.frames, this.encoder, this.used("keypoints")];
    // A saved evaluation is a score.
    if (this.used("result") && parts.every((part) => part === null)) return [];
    const need = (
      /** @type {string} */ label,
      /** @type {boolean} */ met,
      /** @type {Slot[]} */ ...roles
    ) => {
      const isBroken = (/** @type {Entry} */ { state, role }) =>
        state === "broken" && roles.some((each) => each === role);
      return { label, met, broken: met ? [] : this.entries.filter(isBroken) };
    };
    const truth = need("ground truth", this.truth !== null, "ground-truth");
    if (this.used("keypoints")) return [need("keypoints", true), truth];
    const images = need("image sequences", this.frames !== null);
    return [
      images,
      truth,
      need("checkpoint (or keypoints)", this.encoder !== null, "checkpoint", "keypoints"),
    ];
  }

  /**
   * What cannot be used, and why, as far as the user has not put that away.
   * @returns {(Entry | Container)[]}
   */
  get broken() {
    return [...this.entries, ...this.containers].filter(({ error }) => error !== "");
  }

  /**
   * Puts away why a file cannot be used.
   * @param {string} path
   */
  dismissError(path) {
    for (const file of this.broken) if (file.path === path) file.error = "";
    this.emit("files");
  }

  // Extraction

  /** The extraction with the checkpoint in use, when its keypoints are the ones wanted. */
  get extraction() {
    return this.used("keypoints") ? null : (this.used("checkpoint")?.extraction ?? null);
  }

  /** Starts the extraction, or goes on with it. */
  extract() {
    this.#paused = false;
    return this.#run();
  }

  /** Stops the extraction at once; the frames done are kept. */
  cancel() {
    this.#paused = true;
    this.extraction?.stop("cancelled");
    this.emit("extraction");
  }

  /** @returns {import("./pkg/index.js").CommandInputs} */
  commandInputs() {
    const truth = this.used("ground-truth");
    const table = this.used("keypoints");
    const keypoints = table?.path;
    return {
      truth: truth?.path ?? "ground_truth.csv",
      options: [
        ...readingWords(truth, "--"),
        ...(table ? readingWords(table, "--keypoints-", truth) : []),
      ],
      ...(keypoints
        ? { keypoints }
        : {
            checkpoint: this.used("checkpoint")?.path,
            frames: commonFolder(this.frameSources.map(({ path }) => path)),
          }),
    };
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
        if (alive()) this.report("unexpected", "error", messageOf(error));
      }
      if (!alive()) return;
      this.reading = null;
      this.emit("files");
    });
    this.#queue = made;
    return made;
  }

  /**
   * Parses a file in the role it has.
   * @param {Entry} entry
   */
  async #parse(entry) {
    const { role, source, path, wanted } = entry;
    entry.content?.free();
    const size = this.#tableSize;
    Object.assign(entry, {
      content: null,
      extraction: null,
      error: "",
      lacksSize: false,
      imageSize: size,
    });
    if (role === "unknown") {
      entry.state = "unknown";
      return;
    }
    try {
      if (role === "checkpoint") {
        const encoder = await this.#extractor.open({ path, blob: await blobOf(source) });
        entry.content = encoder;
        entry.extraction = new Extraction(encoder);
      } else if (role === "result") {
        entry.content = await SavedEvaluation.parse(source);
      } else {
        const table = await parseTable(entry, size);
        entry.content = table;
        entry.notices = table.notices;
      }
      entry.state = "spare";
      if (wanted) this.#prefer(entry);
    } catch (error) {
      entry.state = "broken";
      entry.lacksSize = !size && (await isReadWithSize(entry));
      entry.error = entry.lacksSize ? `${path}: ${LACKS_SIZE}` : readError(error, path);
    }
    entry.wanted = false;
  }

  /** The size of the images that positions in pixels belong to. */
  get #tableSize() {
    return this.frameSize ?? this.saidSize;
  }

  /**
   * Parses what is new, and the tables in pixels when the images have another size.
   * @param {() => boolean} alive
   */
  async #parseEntries(alive) {
    const pending = this.entries.filter((entry) => needsParsing(entry, this.#tableSize));
    if (pending.length === 0) return;
    this.#release();
    for (const [i, entry] of pending.entries()) {
      if (pending.length > 1) this.#read("Reading", i, pending.length);
      entry.wanted ||= entry.state === "used";
      await this.#parse(entry);
      if (!alive()) {
        entry.content?.free();
        return;
      }
    }
    this.reading = null;
  }

  /**
   * Forgets what was made of a file.
   * @param {Entry} entry
   */
  #reopen(entry) {
    entry.extraction?.stop("idle");
    this.#release();
    Object.assign(entry, { state: "new", error: "", notices: [] });
  }

  /** @param {Entry} entry */
  #prefer(entry) {
    for (const other of this.entries) {
      if (other.role === entry.role && other.state === "used") other.state = "spare";
    }
    entry.state = "used";
  }

  /** @param {Entry} entry */
  #take(entry) {
    const at = this.entries.findIndex(({ path }) => path === entry.path);
    if (at < 0) {
      this.entries.push(entry);
      return;
    }
    const before = this.entries[at];
    entry.wanted = before.state === "used";
    // What the user said holds for the file at this path.
    entry.options = before.options;
    if (before.isSaid)
      Object.assign(entry, {
        role: before.role,
        isSaid: true,
        isGuess: false,
        reason: before.reason,
      });
    entry.reason += `${entry.reason ? "; " : ""}replaces the file of the same path from before`;
    before.extraction?.stop("idle");
    this.#release();
    before.content?.free();
    before.arrays?.free();
    this.entries[at] = entry;
  }

  /**
   * Takes away the images of a container, and the containers in it and itself; gives the images.
   * @param {Container} container
   */
  #emptied(container) {
    const isInside = insideOf(container);
    const images = this.containers.some(({ path }) => path === container.path)
      ? [...this.images.values()].filter(isInside)
      : [];
    for (const image of images) this.#dropImage(image.path);
    for (const path of this.runs.keys()) if (isInside({ path })) this.runs.delete(path);
    this.containers = this.containers.filter((other) => !isInside(other));
    return images;
  }

  /** @param {Source} image */
  #takeImage(image) {
    this.images.set(image.path, image);
    for (const { extraction } of this.entries) extraction?.forget(image.path);
  }

  /** @param {string} path */
  #dropImage(path) {
    this.images.delete(path);
    for (const { extraction } of this.entries) extraction?.forget(path);
  }

  /** @param {string[]} paths that more than one file of a drop had */
  #tellRepeated(paths) {
    if (paths.length === 0) return;
    const text =
      `${count(paths.length, "file")} had the path of another one in the same drop: ` +
      `${names(paths.slice(0, 5), paths.length)}. ` +
      "The first of each is used, the others are not; rename them, or drop their folders one by " +
      "one.";
    this.report("repeated", "warning", text);
  }

  /** @param {Map<string, Source>} images the former ones, by path */
  #tellReplaced(images) {
    if (images.size === 0) return;
    const paths = [...images.keys()];
    const text =
      `${count(images.size, "image")} took the place of those with the same path from before: ` +
      `${names(paths.slice(0, 3), paths.length)}. If these are other sequences, give their ` +
      "folder another name.";
    const restore = () =>
      this.#change(async () => {
        this.problems.delete("replaced");
        for (const image of images.values()) this.#takeImage(image);
      });
    this.report("replaced", "warning", text, {
      label: "Use the former ones again",
      run: () => void restore(),
    });
  }

  /** @param {Entry} entry */
  #drop(entry) {
    entry.extraction?.stop("idle");
    this.entries = this.entries.filter((other) => other !== entry);
    this.#release();
    entry.content?.free();
    entry.arrays?.free();
    entry.content = null;
  }

  /** @param {() => boolean} alive */
  async #settle(alive) {
    for (const { extraction } of this.entries) extraction?.stop("idle");
    for (const key of [...this.problems.keys()])
      if (!STICKY.includes(key)) this.problems.delete(key);
    await this.#indexFrames();
    await this.#parseEntries(alive);
    if (!alive()) return;
    for (const [role, many] of SLOTS) this.#assign(role, many);
    this.#joinFrames();
    this.emit("files");
    this.#advance();
  }

  async #indexFrames() {
    this.frames?.free();
    this.frames = null;
    const images = [...this.images.values()];
    try {
      if (images.length > 0) this.frames = FrameIndex.ofAll(images.map(({ path }) => path));
    } catch (error) {
      // E.g. a copy of an image beside its original: which rows the images belong to cannot be
      // told.
      this.report("frames", "error", messageOf(error), {
        label: "Remove the images",
        run: () => void this.removeImages(),
      });
    }
    const first = this.frameSources[0];
    this.frameSources = Array.from(this.frames?.order ?? [], (position) => images[position]);
    if (this.frameSources[0] !== first) this.frameSize = await this.#firstSize();
  }

  /**
   * Width and height of the first image; one that cannot be read is told when its keypoints are
   * extracted.
   * @returns {Promise<[number, number] | undefined>}
   */
  async #firstSize() {
    const [first] = this.frameSources;
    try {
      const image = first && (await decodeImage(first));
      if (!image) return undefined;
      const { width, height } = image;
      image.close();
      return [width, height];
    } catch {
      return undefined;
    }
  }

  /**
   * Decides which file of a kind is used: the one the user said, or the first.
   * @param {Slot} role
   * @param {string | null} many what to call them where only one of them can be of use
   */
  #assign(role, many) {
    const candidates = this.entries.filter((entry) => entry.role === role && entry.content);
    if (candidates.length === 0) return;
    const used = candidates.find(({ state }) => state === "used") ?? candidates[0];
    used.state = "used";
    const spare = candidates.find((entry) => entry !== used);
    if (!spare || many === null) return;
    const all = names(candidates.map(({ path }) => path));
    const text =
      `There are ${candidates.length} ${many}: ${all}. ` +
      `${this.#useOfSeveral(used, candidates)}`;
    if (this.#dismissed.has(text)) return;
    const isCompared = this.isCompared(spare);
    const action = {
      label: `${isCompared ? "Show" : "Use"} ${spare.path} instead`,
      run: () => void this.use(spare),
    };
    this.report(`several-${role}`, isCompared ? "info" : "warning", text, action);
  }

  /**
   * @param {Entry} used
   * @param {Entry[]} all
   */
  #useOfSeveral(used, all) {
    if (!this.isCompared(used)) return `Only one can be used: ${used.path} is.`;
    const whole = all.length === 2 ? "both" : "all of them";
    const condition = used.role === "checkpoint" ? ", each once its keypoints are extracted" : "";
    return (
      `The results are those of ${used.path}; ${whole} are compared under “Runs side by ` +
      `side”${condition}.`
    );
  }

  /**
   * Whether a file is a detector that can be scored on what is here, and so is compared with the
   * others.
   * @param {Entry} entry
   */
  isCompared({ role, content }) {
    if (!this.truth || !content) return false;
    return role === "keypoints" || (role === "checkpoint" && this.frames !== null);
  }

  #joinFrames() {
    this.join = null;
    if (!this.frames || !this.truth || this.used("keypoints")) return;
    try {
      this.join = joinFrames(this.frames, this.truth);
    } catch (error) {
      this.report("join", "error", messageOf(error));
    }
  }

  /** From keypoints to a score, or to the extraction that is needed first. */
  #advance() {
    this.#release();
    const index = this.#keypoints();
    if (this.table && this.truth) this.#score(index);
    if (!this.scoring) this.#showSaved();
    this.emit("scoring");
    this.emit("extraction");
    if (!this.table && this.join && !this.#paused && this.extraction?.status !== "failed")
      void this.#run();
  }

  /**
   * Sets the table of keypoints, if they are there, and returns the images they belong to.
   * @returns {{ frames: FrameIndex, sources: Source[] } | null}
   */
  #keypoints() {
    const given = this.used("keypoints");
    const all = this.frames ? { frames: this.frames, sources: this.frameSources } : null;
    if (given) {
      this.table = /** @type {KeypointTable} */ (given.content);
      return all;
    }
    const { extraction, encoder } = this;
    if (
      !this.frames ||
      !all ||
      !extraction ||
      !encoder ||
      extraction.pending(this.frameSources).length > 0
    )
      return null;
    const found = extraction.collect(this.frames, this.frameSources);
    if (!found) {
      const [first] = extraction.failures.values();
      this.report(
        "frames",
        "error",
        `None of the ${count(this.frameSources.length, "frame")} has keypoints: ${first}`,
      );
      return null;
    }
    if (found.selected) this.#derived.push(found.selected);
    this.table = found.table;
    this.#derived.push(this.table);
    return { frames: found.selected ?? this.frames, sources: found.sources };
  }

  /**
   * @param {{ frames: FrameIndex, sources: Source[] } | null} index
   */
  #score(index) {
    const { truth, table } = this;
    if (!truth || !table) return;
    /** @type {Scoring} */
    let scoring;
    try {
      scoring = new Scoring(truth, table, this.#excludeNonFinite ? "exclude-frame" : "error");
    } catch (error) {
      const leaveOut = {
        label: "Leave these frames out",
        run: () => {
          this.#excludeNonFinite = true;
          void this.#change(async () => {});
        },
      };
      this.report(
        "scoring",
        "error",
        messageOf(error),
        kindOf(error) === "numeric" ? leaveOut : undefined,
      );
      return;
    }
    this.#derived.push(scoring);
    this.join = scoring.join;
    const positions = index ? Array.from(scoring.imagesFrom(index.frames)) : [];
    const pictures = positions.map((position) =>
      position < 0 ? null : (index?.sources[position] ?? null),
    );
    this.show({ scoring, pictures, sizes: this.#measure(pictures), encoder: this.encoder });
  }

  /** Shows an evaluation that was saved, unless a score is about to come. */
  #showSaved() {
    const entry = this.used("result");
    const { extraction } = this;
    const isComing =
      this.join !== null && extraction !== null && !this.#paused && extraction.status !== "failed";
    if (entry && !isComing) this.showSaved(entry);
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
    // The viewer says so when it comes to an image that cannot be decoded; errors in pixels are
    // left out then.
    const size = pictures.some((picture) => picture !== null) ? this.frameSize : this.saidSize;
    return size ? [size] : [];
  }

  async #run() {
    const { extraction } = this;
    if (
      !extraction ||
      extraction.status === "running" ||
      extraction.pending(this.frameSources).length === 0
    )
      return;
    const generation = this.#generation;
    const alive = () => generation === this.#generation && this.extraction === extraction;
    const running = extraction.run(this.frameSources, () => this.emit("extraction"));
    this.emit("extraction");
    const complete = await running;
    if (!alive()) return;
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
    for (const made of this.#derived.reverse()) made.free();
    this.#derived = [];
    this.table = null;
    this.forgetScore();
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
}

/**
 * Whether there is neither anything of use in files, nor anything that would be if it could be
 * read.
 * @param {import("./files/intake.js").Found} found
 */
function isNothing({ images, runs, entries, containers }) {
  const isUseless = entries.every(({ role, error }) => role === "unknown" && error === "");
  return (
    images.length + runs.size === 0 && isUseless && containers.every(({ error }) => error === "")
  );
}

/**
 * Whether two files are the same one, as far as their outside tells.
 * @param {Source} a
 * @param {Source} b
 */
function isSame(a, b) {
  if ("read" in a || "read" in b || !(a.blob instanceof File) || !(b.blob instanceof File))
    return false;
  return a.blob.size === b.blob.size && a.blob.lastModified === b.blob.lastModified;
}

/**
 * Whether something is a container or lies in it.
 * @param {Container} container
 */
function insideOf({ path, folder }) {
  return (/** @type {{ path: string }} */ item) =>
    item.path === path || item.path.startsWith(`${folder}/`);
}

/**
 * What the user said of a table's numbers, in words of the terminal.
 * @param {Entry | null} entry
 * @param {string} prefix
 * @param {Entry | null} [other] the table whose axis order holds for this one, too, in the terminal
 */
function readingWords(entry, prefix, other) {
  const { space, axisOrder, indexBase } = entry?.options ?? {};
  const content = entry?.content ?? null;
  const reading = isTable(content) ? content.reading : null;
  const own = reading?.axisOrder.value;
  const axes =
    axisOrder ?? (other?.options.axisOrder === own ? undefined : other?.options.axisOrder && own);
  return [
    ...(space ? [`${prefix}space`, space] : []),
    ...(axes ? [`${prefix}axis-order`, axes] : []),
    ...(indexBase === undefined ? [] : [`${prefix}index-base`, String(indexBase)]),
  ];
}

/**
 * The folder that all sequences of images lie in.
 * @param {string[]} paths
 */
function commonFolder(paths) {
  if (paths.length === 0) return ".";
  const folders = paths.map((path) => path.split("/").slice(0, -1));
  let depth = 0;
  while (folders.every((folder) => depth < folder.length && folder[depth] === folders[0][depth]))
    depth++;
  const common = folders[0].slice(0, depth);
  // A single sequence is itself in all paths.
  if (common.length > 0 && folders.every((folder) => folder.length === common.length)) common.pop();
  return common.join("/") || ".";
}
