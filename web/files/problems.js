// @ts-check
/** What the user should know, with the remedy where the page has one. */

import { messageOf } from "../errors.js";

/**
 * @typedef {import("../errors.js").Reason} Reason
 * @typedef {import("../pkg/index.js").TableOptions} TableOptions
 * @typedef {{ label: string, run: () => void }} Action
 *
 * @typedef {object} Problem
 * @property {"error" | "warning" | "info"} kind
 * @property {string} text
 * @property {Action} [action]
 */

/** Says `change` when it is told that a group of changes is complete. */
export class Problems extends EventTarget {
  /** By what they are about. @type {Map<string, Problem>} */
  #problems = new Map();
  /** Texts that the user has put away for good. @type {Set<string>} */
  #dismissed = new Set();

  /**
   * @param {string} key
   * @param {Problem["kind"]} kind
   * @param {string} text
   * @param {Action} [action]
   */
  report(key, kind, text, action) {
    this.#problems.set(key, { kind, text, action });
  }

  /**
   * @param {string} key
   * @param {unknown} error
   */
  fail(key, error) {
    this.report(key, "error", messageOf(error));
  }

  /**
   * Reports something about the choice of files, unless the user has dismissed it.
   * @param {string} key
   * @param {Problem["kind"]} kind
   * @param {string} text
   * @param {Action} [action]
   */
  offer(key, kind, text, action) {
    if (!this.#dismissed.has(text)) this.report(key, kind, text, action);
  }

  /** @param {string} key */
  delete(key) {
    return this.#problems.delete(key);
  }

  /**
   * Forgets all but these.
   * @param {string[]} kept
   */
  settle(kept) {
    for (const key of this.#problems.keys()) if (!kept.includes(key)) this.#problems.delete(key);
  }

  clear() {
    this.#problems.clear();
    this.#dismissed.clear();
  }

  /**
   * Puts a problem away.
   * @param {string} key
   */
  dismiss(key) {
    const problem = this.#problems.get(key);
    if (problem) this.#dismissed.add(problem.text);
    this.#problems.delete(key);
    this.changed();
  }

  changed() {
    this.dispatchEvent(new Event("change"));
  }

  /** @returns {({ key: string } & Problem)[]} */
  get all() {
    return Array.from(this.#problems, ([key, problem]) => ({ key, ...problem }));
  }
}

/**
 * The other way to read a table that looks wrong, by the type of the reason: what it looks like,
 * and how to read it then.
 * @type {Map<string, { text: string, label: string, options: TableOptions }>}
 */
const READINGS = new Map([
  [
    "looksLikePixels",
    {
      text: "its coordinates look like pixels, but are read as ndc (−1 to +1)",
      label: "Read as pixels",
      options: { space: "px" },
    },
  ],
  [
    "looksLikeNdc",
    {
      text: "its coordinates look like ndc (−1 to +1), but are read as pixels",
      label: "Read as ndc",
      options: { space: "ndc" },
    },
  ],
  [
    "looksLikeFractions",
    {
      text:
        "no coordinate is negative, as in a unit from 0 to 1; expected ndc, −1 to +1 across the " +
        "image",
      label: "Read as 0 to 1",
      options: { space: "fraction" },
    },
  ],
]);

/**
 * The key of what is asked about the reading of a table.
 * @param {string} path
 */
export function readingKey(path) {
  return `reading ${path}`;
}

/**
 * Asks how to read a table that looks as if it were in another unit.
 * @param {Problems} problems
 * @param {string} path
 * @param {Reason[]} reasons of the table
 * @param {(options: TableOptions) => void} read
 */
export function askForReading(problems, path, reasons, read) {
  for (const { type } of reasons) {
    const reading = READINGS.get(type);
    if (!reading) continue;
    problems.offer(readingKey(path), "warning", `${path}: ${reading.text}.`, {
      label: reading.label,
      run: () => read(reading.options),
    });
  }
}
