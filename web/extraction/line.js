// @ts-check
/**
 * The page's end of one extraction worker: questions, answers, and how the page learns that it
 * died.
 */

import { blobOf, readError } from "../files/sources.js";

/**
 * @typedef {import("./extractor.js").Source} Source
 * @typedef {import("./worker.js").Reply} Reply
 * @typedef {import("./worker.js").Request} Request
 * @typedef {Extract<Reply, { type: "extracted" | "failed" }>} Result
 */

/**
 * A worker that ends before it has its lock says nothing: one that takes this long to start is
 * taken for dead.
 */
const START_MS = 60_000;

export class Line {
  /**
   * Of the encoder in the worker, once it is open.
   * @type {import("./extractor.js").Info | null}
   */
  info = null;
  /** Bytes that the worker's instance holds. */
  memory = 0;
  /** Whether `memory` is that of a frame done. */
  measured = false;
  /** Frames dealt and not answered, by their number in the run, oldest first. @type {number[]} */
  dealt = [];
  /**
   * Takes the answers to the frames dealt, in their order.
   * @type {(frame: number, result: Result) => void}
   */
  onResult = () => {};
  /**
   * Called once, when the worker broke down or ended without being asked to.
   * @type {(message: string) => void}
   */
  onDeath = () => {};
  /**
   * Called once, when something that no image is to blame for keeps all workers from going on.
   * @type {(message: string) => void}
   */
  onLack = () => {};

  #name = globalThis.crypto?.randomUUID?.() ?? "";
  #worker = new Worker(new URL("./worker.js", import.meta.url), {
    type: "module",
    name: this.#name,
  });
  #closed = new AbortController();
  #start = setTimeout(() => this.#die("it did not start within a minute"), START_MS);
  /** Requests go out in their order, also where one has to be unpacked first. */
  #sent = Promise.resolve();

  /**
   * Starts a worker and opens a checkpoint in it.
   * @param {import("./worker.js").Part} part of the package that computes it
   * @param {WebAssembly.Module} module of the part
   * @param {import("./extractor.js").Given} source
   * @returns {Promise<Line>}
   */
  static open(part, module, source) {
    return new Promise((resolve, reject) => {
      const line = new Line();
      line.onDeath = (message) =>
        reject(new Error(`${source.path} could not be opened: ${message}`));
      line.#worker.onerror = (event) => {
        event.preventDefault();
        line.#die(event.message || "its script could not be loaded");
      };
      line.#worker.onmessage = ({ data }) => line.#answered(data, resolve, reject);
      line.#ask({ type: "open", part, module, source });
    });
  }

  /**
   * Gives the worker a frame; the answer comes to `onResult`.
   * @param {number} frame
   * @param {Source} source
   */
  deal(frame, source) {
    this.dealt.push(frame);
    const { path } = source;
    const request = blobOf(source).then(
      (blob) => /** @type {Request} */ ({ type: "extract", source: { path, blob } }),
      (error) => /** @type {Request} */ ({ type: "refuse", message: readError(error, path) }),
    );
    this.#sent = this.#sent.then(async () => this.#ask(await request));
  }

  /** Ends the worker at once, whatever it is at. */
  close() {
    clearTimeout(this.#start);
    this.#closed.abort();
    this.#worker.terminate();
  }

  /** @param {Request} request */
  #ask(request) {
    this.#worker.postMessage(request);
  }

  /**
   * @param {Reply} reply
   * @param {(line: Line) => void} opened
   * @param {(error: Error) => void} refused
   */
  #answered(reply, opened, refused) {
    if (this.#closed.signal.aborted) return;
    switch (reply.type) {
      case "started":
        clearTimeout(this.#start);
        this.#watch();
        return;
      case "opened":
        this.info = reply.info;
        this.memory = reply.memory;
        opened(this);
        return;
      case "crashed":
        this.#die(reply.message);
        return;
      case "lacking":
        this.close();
        this.onLack(reply.message);
        return;
      case "failed":
        if (this.dealt.length === 0) {
          this.close();
          refused(Object.assign(new Error(reply.message), { reason: reply.cause }));
          return;
        }
        break;
      case "extracted":
        this.memory = reply.memory;
        this.measured = true;
    }
    this.onResult(/** @type {number} */ (this.dealt.shift()), reply);
  }

  /** The worker holds a lock of its name, which the page gets when the worker is gone. */
  #watch() {
    const { signal } = this.#closed;
    navigator.locks
      ?.request(this.#name, { signal }, () => this.#die("it ended without a report"))
      .catch(() => {});
  }

  /** @param {string} message */
  #die(message) {
    if (this.#closed.signal.aborted) return;
    this.close();
    this.onDeath(`the worker broke down (${message})`);
  }
}
