// @ts-check
/**
 * One run of an extraction: frames are dealt to workers in their order and reported in their order.
 * A worker that dies is replaced, and its frames go to others; a frame that brings workers down is
 * reported as failed.
 */

import { messageOf } from "../errors.js";

/**
 * @typedef {import("./line.js").Line} Line
 * @typedef {import("./line.js").Result} Result
 * @typedef {import("./extractor.js").Job} Job
 */

/** Frames a worker has at a time: the next one is read while one is computed. */
const DEALT = 2;
/** Frames a worker that may be under way, or done and waiting for an earlier one. */
const WINDOW = 8;
/**
 * Workers that a frame may go down with, the last time as the only one there, before it is given
 * up.
 */
const ATTEMPTS = 2;
/** Workers that may go down with no frame done in between before the run is given up. */
const HOPELESS = 16;

const GIB = 2 ** 30;
/** The memory of a device that does not say. */
const DEVICE_GIB = 4;
/** The share of it that the workers may take together. */
const SHARE = 1 / 4;

export class Run {
  #job;
  #start;
  /** @type {Set<Line>} */
  #lines = new Set();
  /** Workers on their way. */
  #starting = 0;
  /** Workers there may be. */
  #limit = navigator.hardwareConcurrency || 2;
  /** Why there are not more. */
  #refusal = "";
  /** Frames from here on were never dealt. */
  #next = 0;
  /**
   * Frames to deal once more, ascending. Each goes to a worker that has no other one, so as to tell
   * who is to blame.
   * @type {number[]}
   */
  #again = [];
  /** Workers that a frame dealt once more went down with. @type {Map<number, number>} */
  #deathsOf = new Map();
  /** Workers that went down since a frame was done. */
  #deaths = 0;
  /** Frames before this one are reported. */
  #reported = 0;
  /** Results that wait for those of earlier frames. @type {Map<number, Result>} */
  #early = new Map();
  #over = false;
  /** @type {() => void} */
  #resolve = () => {};
  /** @type {(reason: unknown) => void} */
  #reject = () => {};
  /** Settles when the run is over. @type {Promise<void>} */
  done;

  /**
   * @param {Job} job
   * @param {Iterable<Line>} lines workers that are there already
   * @param {() => Promise<Line>} start starts another one
   */
  constructor(job, lines, start) {
    this.#job = job;
    this.#start = start;
    this.done = new Promise((resolve, reject) => {
      this.#resolve = resolve;
      this.#reject = reject;
    });
    job.signal.addEventListener("abort", this.#aborted);
    for (const line of lines) this.#join(line);
    this.#advance();
  }

  /** Workers with nothing to do, once the run is over; the others were ended. */
  get left() {
    return this.#lines;
  }

  #aborted = () => this.#end(() => this.#reject(this.#job.signal.reason));

  /** @param {string} message */
  #fail(message) {
    this.#end(() => this.#reject(new Error(message)));
  }

  /** @param {() => void} settle */
  #end(settle) {
    if (this.#over) return;
    this.#over = true;
    this.#job.signal.removeEventListener("abort", this.#aborted);
    for (const line of this.#lines) {
      if (line.dealt.length === 0) continue;
      line.close();
      this.#lines.delete(line);
    }
    settle();
  }

  /** Does what can be done now. */
  #advance() {
    if (this.#over) return;
    if (this.#reported === this.#job.frames.length) {
      this.#end(this.#resolve);
      return;
    }
    this.#deal();
    this.#grow();
    if (this.#lines.size + this.#starting === 0) {
      this.#fail(
        `no worker of the extraction is left, and none could be started: ${this.#refusal}. What ` +
          "is done is kept; if trying " +
          "again does not help, reload the page.",
      );
    }
  }

  /** Deals frames to the workers that have the fewest. */
  #deal() {
    for (let held = 0; held < DEALT; held++) {
      for (const line of this.#lines) {
        if (line.dealt.length !== held || this.#deathsOf.has(line.dealt[0])) continue;
        const frame = (held === 0 ? this.#again.shift() : undefined) ?? this.#take();
        if (frame === null) break;
        line.deal(frame, this.#job.frames[frame]);
      }
    }
  }

  /**
   * The next frame to deal for the first time, or `null`: those that wait for an earlier one are
   * bounded.
   */
  #take() {
    const end = Math.min(this.#job.frames.length, this.#reported + WINDOW * this.#lines.size);
    return this.#next < end ? this.#next++ : null;
  }

  /** Starts workers as long as frames wait, and cores and memory reach. */
  #grow() {
    const waiting = () =>
      this.#job.frames.length - this.#next + this.#again.length - this.#starting;
    while (this.#lines.size + this.#starting < this.#limit && waiting() > 0 && this.#fits()) {
      this.#starting++;
      this.#start().then(
        (line) => {
          this.#starting--;
          if (this.#over) {
            line.close();
            return;
          }
          this.#join(line);
          this.#advance();
        },
        (error) => {
          this.#starting--;
          this.#refusal = messageOf(error);
          // What keeps one from starting would keep the next one too.
          this.#limit = this.#lines.size + this.#starting;
          this.#advance();
        },
      );
    }
  }

  /**
   * Whether there is memory for one more worker: what one needs is known when one has done a frame.
   */
  #fits() {
    const lines = [...this.#lines];
    if (lines.length + this.#starting === 0) return true;
    const measured = lines.filter((line) => line.measured);
    const largest = Math.max(...measured.map((line) => line.memory));
    return measured.length > 0 && memoryOf(lines) + (this.#starting + 1) * largest <= budget();
  }

  /** @param {Line} line */
  #join(line) {
    this.#lines.add(line);
    line.onResult = (frame, result) => this.#answered(line, frame, result);
    line.onDeath = (message) => this.#died(line, message);
    line.onLack = (message) => {
      this.#lines.delete(line);
      this.#fail(`${message}. What is done is kept; try again.`);
    };
  }

  /**
   * @param {Line} line
   * @param {number} frame
   * @param {Result} result
   */
  #answered(line, frame, result) {
    this.#deaths = 0;
    this.#settle(frame, result);
    if (this.#over) return;
    // Frames were larger than those the number of workers was chosen by.
    if (this.#lines.size > 1 && memoryOf(this.#lines) > budget()) {
      this.#lines.delete(line);
      line.close();
      this.#redo(line.dealt);
    }
    this.#advance();
  }

  /**
   * @param {Line} line
   * @param {string} message
   */
  #died(line, message) {
    this.#lines.delete(line);
    const [first] = line.dealt;
    if (first === undefined) {
      this.#advance();
      return;
    }
    if (++this.#deaths >= HOPELESS) {
      this.#fail(
        `${this.#deaths} workers in a row broke down, the last one with ` +
          `${this.#job.frames[first].path}: ${message}. What is ` +
          "done is kept; close other tabs if memory is short, and try again.",
      );
      return;
    }
    for (const frame of line.dealt) this.#deathsOf.set(frame, (this.#deathsOf.get(frame) ?? 0) + 1);
    if (line.dealt.length === 1 && Number(this.#deathsOf.get(first)) >= ATTEMPTS) {
      this.#settle(first, { type: "failed", message: `${message}, and so did the one before it` });
    } else {
      this.#redo(line.dealt);
    }
    this.#advance();
  }

  /** @param {number[]} frames */
  #redo(frames) {
    for (const frame of frames) this.#deathsOf.set(frame, this.#deathsOf.get(frame) ?? 0);
    this.#again = [...this.#again, ...frames].sort((a, b) => a - b);
  }

  /**
   * Reports a frame and those that waited for it.
   * @param {number} frame
   * @param {Result} result
   */
  #settle(frame, result) {
    this.#early.set(frame, result);
    for (;;) {
      const next = this.#early.get(this.#reported);
      // What is reported may end the run.
      if (!next || this.#over) return;
      this.#early.delete(this.#reported);
      const { path } = this.#job.frames[this.#reported++];
      if (next.type === "extracted") this.#job.onFrame(path, next);
      else this.#job.onFailure(path, next.message);
    }
  }
}

/** @param {Iterable<Line>} lines */
function memoryOf(lines) {
  let bytes = 0;
  for (const { memory } of lines) bytes += memory;
  return bytes;
}

/** Bytes that the workers may take together. */
function budget() {
  const { deviceMemory = DEVICE_GIB } = /** @type {{ deviceMemory?: number }} */ (navigator);
  return deviceMemory * GIB * SHARE;
}
