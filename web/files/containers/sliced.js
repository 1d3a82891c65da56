// @ts-check
/**
 * Recordings of any size: points are read, frames stay where they lie, and a worker reads them piece
 * by piece.
 */

import { compile } from "../../pkg/index.js";
import { NPY_TYPE } from "./npy.js";

/**
 * @typedef {import("../sources.js").Source} Source
 * @typedef {import("./recording-worker.js").Opened} Opened
 * @typedef {import("./recording-worker.js").Place} Place
 * @typedef {import("./recording-worker.js").Reply} Reply
 * @typedef {({ type: "open" } & import("./recording-worker.js").ToOpen)
 *   | { type: "frame", frame: number }
 *   | { type: "named", columns: string }} Asked
 */

/** The parts of the package that read them. */
const PARTS = /** @type {const} */ ({ hdf5: "formats", zarr: "zarr" });

/** The compiled parts, once they are fetched. @type {Map<string, Promise<WebAssembly.Module>>} */
const compiled = new Map();

/**
 * Opens a recording; `close` ends its worker.
 * @param {string} path
 * @param {Place} place
 * @param {string} [camera] of several the one whose frames are wanted, instead of the first
 * @returns {Promise<Omit<Opened, "paths"> & { frames: Source[], close: () => void, named: (columns:
 * string) => Promise<Opened["points"]> }>}
 */
export async function openSliced(path, place, camera) {
  const module = await moduleOf(place.kind);
  const file = new SlicedFile();
  try {
    const reply = await file.ask({ type: "open", module, path, place, camera });
    if (!("opened" in reply)) throw new Error("the worker did not open the file");
    const { paths, ...opened } = reply.opened;
    const frames = paths.map((frame, i) => ({
      path: `${path}/${frame}`,
      read: () => file.frame(i),
    }));
    if (frames.length === 0 && opened.candidates.length === 0) file.close();
    const named = (/** @type {string} */ columns) => file.named(columns);
    return { ...opened, frames, named, close: () => file.close() };
  } catch (error) {
    file.close();
    throw error;
  }
}

/** @param {Place["kind"]} kind */
async function moduleOf(kind) {
  const part = PARTS[kind];
  const module = compiled.get(part) ?? compile(part);
  compiled.set(part, module);
  return module.catch((error) => {
    compiled.delete(part);
    throw error;
  });
}

/** A file in a worker of its own. */
class SlicedFile {
  #worker = new Worker(new URL("./recording-worker.js", import.meta.url), { type: "module" });
  /** @type {Map<number, { done: (reply: Reply) => void, fail: (error: Error) => void }>} */
  #waiting = new Map();
  #asked = 0;

  constructor() {
    this.#worker.onmessage = (/** @type {MessageEvent<Reply>} */ { data }) => {
      const waiting = this.#waiting.get(data.number);
      this.#waiting.delete(data.number);
      if ("error" in data) waiting?.fail(new Error(data.error));
      else waiting?.done(data);
    };
    this.#worker.onerror = (event) => {
      event.preventDefault();
      this.#end(event.message || "the worker that reads the file has ended");
    };
  }

  /**
   * @param {Asked} asked
   * @returns {Promise<Reply>}
   */
  ask(asked) {
    const number = this.#asked++;
    return new Promise((done, fail) => {
      this.#waiting.set(number, { done, fail });
      this.#worker.postMessage({ number, ...asked });
    });
  }

  /** @param {number} frame */
  async frame(frame) {
    const reply = await this.ask({ type: "frame", frame });
    return new Blob("frame" in reply ? [reply.frame] : [], { type: NPY_TYPE });
  }

  /** @param {string} columns */
  async named(columns) {
    const reply = await this.ask({ type: "named", columns });
    return "points" in reply ? reply.points : null;
  }

  close() {
    this.#worker.terminate();
    this.#end("the file was removed");
  }

  /** @param {string} why */
  #end(why) {
    for (const { fail } of this.#waiting.values()) fail(new Error(why));
    this.#waiting.clear();
  }
}
