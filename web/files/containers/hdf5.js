// @ts-check
/** HDF5 files: points are read, frames stay in the file, which a worker reads by slices. */

import { compile } from "../../pkg/index.js";
import { NPY_TYPE } from "./npy.js";

/**
 * @typedef {import("../sources.js").Source} Source
 * @typedef {import("./hdf5-worker.js").Opened} Opened
 * @typedef {import("./hdf5-worker.js").Reply} Reply
 * @typedef {({ type: "open" } & import("./hdf5-worker.js").File)
 *   | { type: "frame", frame: number }} Asked
 */

/** The compiled part, once it is fetched. @type {Promise<WebAssembly.Module> | undefined} */
let part;

/**
 * Opens a file; `close` ends its worker.
 * @param {string} path
 * @param {Blob} blob
 * @param {string} [camera] of several the one whose frames are wanted, instead of the first
 * @returns {Promise<{ frames: Source[], points: Opened["points"], cameras: string[], problem:
 * string, close: () => void }>}
 */
export async function openHdf5(path, blob, camera) {
  part ??= compile("formats");
  const module = await part.catch((error) => {
    part = undefined;
    throw error;
  });
  const file = new SlicedFile();
  try {
    const reply = await file.ask({ type: "open", module, path, blob, camera });
    if (!("opened" in reply)) throw new Error("the worker did not open the file");
    const { paths, points, cameras, problem } = reply.opened;
    const frames = paths.map((frame, i) => ({
      path: `${path}/${frame}`,
      read: () => file.frame(i),
    }));
    if (frames.length === 0) file.close();
    return { frames, points, cameras, problem, close: () => file.close() };
  } catch (error) {
    file.close();
    throw error;
  }
}

/** A file in a worker of its own. */
class SlicedFile {
  #worker = new Worker(new URL("./hdf5-worker.js", import.meta.url), { type: "module" });
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
