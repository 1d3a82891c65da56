// @ts-check
/**
 * Extraction by a pool of workers, each with its own single-threaded instance of the CPU engine.
 * They share no memory, so that the page needs no special headers, but the compiled module, and
 * read the files they are dealt themselves.
 */

import { isModel } from "./extractor.js";
import { Line } from "./line.js";
import { Run } from "./run.js";
import { compile } from "../pkg/index.js";

/**
 * @typedef {import("./extractor.js").Extractor} Extractor
 * @typedef {import("./extractor.js").Given} Given
 * @typedef {import("./extractor.js").Info} Info
 * @typedef {import("./extractor.js").Job} Job
 * @typedef {import("./extractor.js").OpenEncoder} OpenEncoder
 * @typedef {import("./worker.js").Part} Part
 */

/** Bytes of workers that are kept from run to run; one is kept in any case. */
const WARM = 2 ** 28;

/** @implements {Extractor} */
export class WorkerPool {
  /** The parts of the package that were asked for. @type {Map<Part, Promise<WebAssembly.Module>>} */
  #modules = new Map();
  /** The encoder used last, the only one whose workers are kept. @type {PooledEncoder | null} */
  #warm = null;

  /**
   * @param {Given} checkpoint
   * @returns {Promise<OpenEncoder>}
   */
  async open(checkpoint) {
    const part = isModel(checkpoint.path) ? "onnx" : "extraction";
    const start = async () => Line.open(part, await this.#compiled(part), checkpoint);
    const encoder = new PooledEncoder(this, start, await start());
    this.use(encoder);
    return encoder;
  }

  /**
   * Keeps the workers of this encoder, and of no other one.
   * @param {PooledEncoder} encoder
   */
  use(encoder) {
    if (this.#warm !== encoder) this.#warm?.cool();
    this.#warm = encoder;
  }

  /** @param {Part} part */
  #compiled(part) {
    const known = this.#modules.get(part);
    if (known) return known;
    const compiled = compile(part).catch((error) => {
      this.#modules.delete(part);
      throw error;
    });
    this.#modules.set(part, compiled);
    return compiled;
  }
}

/** @implements {OpenEncoder} */
class PooledEncoder {
  info;
  /** Workers that wait for the next run. @type {Set<Line>} */
  #idle = new Set();
  #pool;
  #start;
  #freed = false;

  /**
   * @param {WorkerPool} pool
   * @param {() => Promise<Line>} start starts a worker with this encoder
   * @param {Line} first
   */
  constructor(pool, start, first) {
    this.info = /** @type {Info} */ (first.info);
    this.#pool = pool;
    this.#start = start;
    this.#keep([first]);
  }

  /** @param {Job} job */
  async extract(job) {
    job.signal.throwIfAborted();
    this.#pool.use(this);
    const lines = [...this.#idle];
    this.#idle.clear();
    const run = new Run(job, lines, this.#start);
    try {
      await run.done;
    } finally {
      this.#keep(run.left);
    }
  }

  /** Ends the workers that wait. */
  cool() {
    for (const line of this.#idle) line.close();
    this.#idle.clear();
  }

  free() {
    this.#freed = true;
    this.cool();
  }

  /** @param {Iterable<Line>} lines */
  #keep(lines) {
    let bytes = 0;
    for (const line of lines) {
      bytes += line.memory;
      if (this.#freed || (this.#idle.size > 0 && bytes > WARM)) {
        line.close();
        continue;
      }
      this.#idle.add(line);
      line.onDeath = () => this.#idle.delete(line);
    }
  }
}
