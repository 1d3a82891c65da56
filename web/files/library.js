// @ts-check
/** The files taken: images, what they lie in, and all others with what was read from them. */

import { Camera, KeypointTable, GroundTruthTable } from "../pkg/index.js";
import { reasonOf } from "../errors.js";
import { Extraction } from "../extraction/extraction.js";
import { settingsText } from "./model-settings.js";
import { contentOf, extractionOf, isTableRole, tableOf, unread } from "./entry.js";
import { SavedEvaluation } from "./saved.js";
import { blobOf, bytesOf, readError } from "./sources.js";

/**
 * @typedef {import("./entry.js").Content} Content
 * @typedef {import("./entry.js").Entry} Entry
 * @typedef {import("./entry.js").Slot} Slot
 * @typedef {import("./intake.js").Container} Container
 * @typedef {import("./intake.js").Found} Found
 * @typedef {import("./sources.js").Source} Source
 * @typedef {import("../extraction/extractor.js").Extractor} Extractor
 *
 * What a drop did: paths that more than one of its files had, and the images whose place others
 * took.
 * @typedef {{ repeated: string[], replaced: Map<string, Source> }} Taking
 */

const LACKS_SIZE =
  "its positions are in pixels, and the size of the images is not known. Enter it at the file in " +
  "the list, add the images, or choose ndc there if that is the unit.";

export class Library {
  /** @type {Entry[]} */
  entries = [];
  /** Images by path. @type {Map<string, Source>} */
  images = new Map();
  /** The files that held others. @type {Container[]} */
  containers = [];
  /** Folders of runs by path. @type {Map<string, import("./runs.js").RunFolder>} */
  runs = new Map();

  #extractor;
  #beforeUnread;
  /** What files beside ONNX models say, by the paths of the models. @type {Found["settings"]} */
  #settings = new Map();

  /**
   * @param {Extractor} extractor
   * @param {() => void} beforeUnread called before content that others may use is given back
   */
  constructor(extractor, beforeUnread) {
    this.#extractor = extractor;
    this.#beforeUnread = beforeUnread;
  }

  /** The number of files, those in containers counted one by one. */
  get size() {
    return this.entries.length + this.images.size + this.containers.length;
  }

  /**
   * Takes files. One replaces another of the same path; of two in the same drop the first counts.
   * @param {Found} found
   * @returns {Taking}
   */
  take(found) {
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
      this.takeImage(image);
    }
    this.#takeSettings(found.settings);
    for (const entry of found.entries) {
      if (taken.has(entry.path)) {
        repeated.push(entry.path);
        entry.arrays?.free();
        continue;
      }
      taken.add(entry.path);
      this.#takeEntry(entry);
    }
    return { repeated, replaced };
  }

  /** @param {Source} image */
  takeImage(image) {
    this.images.set(image.path, image);
    this.#forgetPoints(image.path);
  }

  /** @param {string} path */
  dropImage(path) {
    this.images.delete(path);
    this.#forgetPoints(path);
  }

  dropImages() {
    for (const path of [...this.images.keys()]) this.dropImage(path);
  }

  /**
   * Gives an image another path. The keypoints of its frame stay.
   * @param {Source} image
   * @param {string} path
   */
  moveImage(image, path) {
    const { path: before } = image;
    this.images.delete(before);
    this.images.set(path, { ...image, path });
    for (const entry of this.entries) extractionOf(entry)?.move(before, path);
  }

  /** @param {Entry} entry */
  drop(entry) {
    this.entries = this.entries.filter((other) => other !== entry);
    this.reopen(entry);
    entry.arrays?.free();
  }

  /**
   * Removes a file and all that lies in it.
   * @param {Container} container
   */
  dropContainer(container) {
    this.#emptied(container);
    for (const entry of this.entries.filter(insideOf(container))) this.drop(entry);
  }

  clear() {
    for (const entry of [...this.entries]) this.drop(entry);
    for (const container of this.containers) container.close();
    this.images.clear();
    this.containers = [];
    this.runs.clear();
    this.#settings.clear();
  }

  /**
   * Uses a file in place of the other one of its kind.
   * @param {Entry} entry
   */
  prefer(entry) {
    for (const { taken, parsed } of this.entries) {
      if (taken.role === entry.taken.role && parsed.state === "used") parsed.state = "spare";
    }
    if ("content" in entry.parsed) entry.parsed.state = "used";
  }

  /**
   * Opens an ONNX model with other settings.
   * @param {Entry} entry
   * @param {import("./model-settings.js").Settings} settings
   */
  setModel(entry, settings) {
    entry.settings = settings;
    entry.wanted ||= entry.parsed.state === "used";
    this.reopen(entry);
  }

  /**
   * Forgets what was read from a file.
   * @param {Entry} entry
   */
  reopen(entry) {
    if (contentOf(entry)) this.#beforeUnread();
    unread(entry);
  }

  /** Whether a table was not read because its points have three coordinates. */
  get isInSpace() {
    return this.entries.some(
      ({ parsed }) => parsed.state === "broken" && parsed.cause?.type === "inSpace",
    );
  }

  /** Forgets what was read from all tables, for another part of the package to read it. */
  async reopenAll() {
    for (const entry of this.entries) {
      if (!isTableRole(entry) && entry.taken.role !== "camera") continue;
      entry.wanted ||= entry.parsed.state === "used";
      this.reopen(entry);
      if (!entry.arrays) continue;
      entry.arrays.free();
      const { arraysOf } = await import("./containers/npz.js");
      entry.arrays = await arraysOf(entry.source);
    }
  }

  /**
   * The file that is used as this.
   * @param {Slot} role
   */
  used(role) {
    const isUsed = (/** @type {Entry} */ { taken, parsed }) =>
      taken.role === role && parsed.state === "used";
    return this.entries.find(isUsed) ?? null;
  }

  /**
   * The files that can be used as this.
   * @param {Slot} role
   */
  usable(role) {
    return this.entries.filter((entry) => entry.taken.role === role && contentOf(entry));
  }

  /**
   * What cannot be used, and why, unless the user has dismissed that.
   * @returns {{ path: string, error: string }[]}
   */
  get broken() {
    const entries = this.entries.flatMap(({ path, parsed }) =>
      parsed.state === "broken" && parsed.error ? [{ path, error: parsed.error }] : [],
    );
    return [...entries, ...this.containers.filter(({ error }) => error !== "")];
  }

  /**
   * Puts away why a file cannot be used.
   * @param {string} path
   */
  dismissError(path) {
    for (const container of this.containers) if (container.path === path) container.error = "";
    for (const { path: own, parsed } of this.entries) {
      if (own === path && parsed.state === "broken") parsed.error = "";
    }
  }

  /**
   * The files to parse: new ones, and those that depend on the size of the images, when that has
   * changed.
   * @param {[number, number] | undefined} imageSize
   */
  pending(imageSize) {
    return this.entries.filter((entry) => {
      const { parsed } = entry;
      if (parsed.state === "new") return true;
      if (!isTableRole(entry) || parsed.state === "unknown") return false;
      if (String(parsed.imageSize) === String(imageSize)) return false;
      return parsed.state === "broken" || tableOf(entry)?.reading.space.value === "px";
    });
  }

  /**
   * Parses a file in the role it has.
   * @param {Entry} entry
   * @param {[number, number] | undefined} imageSize
   */
  async parse(entry, imageSize) {
    entry.wanted ||= entry.parsed.state === "used";
    this.reopen(entry);
    if (entry.taken.role === "unknown") {
      entry.parsed = { state: "unknown" };
      return;
    }
    try {
      const content = await this.#read(entry, entry.taken.role, imageSize);
      entry.parsed = { state: "spare", content, imageSize };
      if (entry.wanted) this.prefer(entry);
    } catch (error) {
      const cause = reasonOf(error);
      const lacksSize = cause?.type === "missingImageSize";
      const text = lacksSize ? `${entry.path}: ${LACKS_SIZE}` : readError(error, entry.path);
      entry.parsed = { state: "broken", error: text, cause, imageSize };
    }
    entry.wanted = false;
  }

  /**
   * @param {Entry} entry
   * @param {Slot} role
   * @param {[number, number] | undefined} imageSize
   * @returns {Promise<Content>}
   */
  async #read({ path, source, arrays, options, settings }, role, imageSize) {
    // The positions of a simulator lie on a board of their own.
    const given = { imageSize, ...options };
    switch (role) {
      case "checkpoint": {
        const given = { path, blob: await blobOf(source), settings: settingsText(settings) };
        const encoder = await this.#extractor.open(given);
        return { kind: role, encoder, extraction: new Extraction(encoder) };
      }
      case "camera":
        return { kind: role, camera: Camera.parse(await bytesOf(source), path) };
      case "result":
        return { kind: role, saved: await SavedEvaluation.parse(source) };
      case "keypoints":
        if (arrays) return { kind: role, table: arrays.keypoints(given) };
        return { kind: role, table: KeypointTable.parse(await bytesOf(source), path, given) };
      case "ground-truth":
        if (arrays) return { kind: role, table: arrays.groundTruth(given) };
        return { kind: role, table: GroundTruthTable.parse(await bytesOf(source), path, given) };
    }
  }

  /** @param {Found["settings"]} settings */
  #takeSettings(settings) {
    for (const [path, said] of settings) {
      this.#settings.set(path, said);
      const entry = this.entries.find((entry) => entry.path === path);
      if (entry) this.setModel(entry, said);
    }
  }

  /**
   * Takes what the user named in a recording, which is read as the user says now.
   * @param {Entry} entry
   */
  takeNamed(entry) {
    const { options } = entry;
    this.#takeEntry(entry);
    entry.options = options;
    entry.wanted = true;
  }

  /** @param {Entry} entry */
  #takeEntry(entry) {
    entry.settings = this.#settings.get(entry.path) ?? {};
    const at = this.entries.findIndex(({ path }) => path === entry.path);
    if (at < 0) {
      this.entries.push(entry);
      return;
    }
    const before = this.entries[at];
    entry.wanted = before.parsed.state === "used";
    // What the user said holds for the file at this path.
    entry.options = before.options;
    entry.settings = before.settings;
    entry.alignment = before.alignment;
    if (before.taken.by === "said") entry.taken = { ...before.taken };
    const { reason } = entry.taken;
    entry.taken.reason = `${reason ? `${reason}; ` : ""}replaces the earlier file of the same path`;
    this.reopen(before);
    before.arrays?.free();
    this.entries[at] = entry;
  }

  /**
   * Takes away the images of a container, and the containers in it and itself; gives the images.
   * @param {Container} container
   */
  #emptied(container) {
    const isInside = insideOf(container);
    const isKnown = this.containers.some(({ path }) => path === container.path);
    const images = isKnown ? [...this.images.values()].filter(isInside) : [];
    for (const image of images) this.dropImage(image.path);
    for (const path of this.runs.keys()) if (isInside({ path })) this.runs.delete(path);
    for (const other of this.containers) if (isInside(other)) other.close();
    this.containers = this.containers.filter((other) => !isInside(other));
    return images;
  }

  /** @param {string} path */
  #forgetPoints(path) {
    for (const entry of this.entries) extractionOf(entry)?.forget(path);
  }
}

/**
 * Whether two files are the same one, as far as their outside tells.
 * @param {Source} a
 * @param {Source} b
 */
function isSame(a, b) {
  if ("read" in a || "read" in b) return false;
  if (!(a.blob instanceof File) || !(b.blob instanceof File)) return false;
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
