// @ts-check
/**
 * Extraction on the CPU or on the GPU, whichever is faster.
 *
 * The CPU begins at once. If there is a GPU and enough left to do, the GPU is made ready beside it,
 * has to find the CPU's keypoints on one frame, and is timed; if it wins, it goes on from the frame
 * the CPU has come to. If it fails, the CPU goes on from the frame the GPU has come to.
 */

import { messageOf } from "../errors.js";
import { fixed, significant } from "../ui/format.js";
import { isModel } from "./extractor.js";
import { GpuWorker, findAdapter } from "./gpu.js";

/**
 * @typedef {import("../files/sources.js").Source} Source
 * @typedef {import("./extractor.js").Extracted} Extracted
 * @typedef {import("./extractor.js").Extractor} Extractor
 * @typedef {import("./extractor.js").OpenEncoder} OpenEncoder
 * @typedef {import("./extractor.js").Job} Job
 * @typedef {import("./gpu.js").Adapter} Adapter
 * @typedef {"automatic" | "cpu" | "gpu"} Choice
 *
 * What computes, and why.
 * @typedef {{ device: "cpu" | "gpu", reason: string }} Verdict
 *
 * What the comparison of the devices gave; with the times, in milliseconds a frame, if they were
 * taken.
 * @typedef {{ agrees: boolean, difference: number, cpu?: number, gpu?: number }} Probe
 *
 * A frame that the CPU has done.
 * @typedef {{ frame: Source, extracted: Extracted }} Sample
 */

/**
 * What coordinates of the two may differ by, in latent units: the CPU's own kernels differ by 1e-4.
 */
const AGREEMENT = 1e-3;
/** Frames that go to the GPU together. */
const BATCH = 16;
/** Batches under way: one is decoded while one is computed. */
const DEALT = 2;
/** What the CPU has left to do must be worth fetching the GPU part and making it ready. */
const WORTH_MS = 3000;
/** The CPU's speed is known after this time, from its last frames. */
const SETTLED_MS = 1000;
const RECENT = 64;

const STORED = "tracklens.device";

/**
 * Fires `change` when `verdict` or `lost` changes.
 * @implements {Extractor}
 */
export class DeviceExtractor extends EventTarget {
  /** @type {Verdict | null} */
  verdict = null;
  /** What happened to the GPU in the middle of an extraction, until it was seen. */
  lost = "";
  /** @type {Adapter | null} */
  adapter = null;

  #cpu;
  #allowSoftware;
  /** @type {Choice} */
  #choice = "automatic";
  /** @type {GpuWorker | null} */
  #worker = null;
  #broken = "";

  /**
   * @param {Extractor} cpu
   * @param {boolean} allowSoftware whether a program that acts as a GPU will do, for tests
   */
  constructor(cpu, allowSoftware) {
    super();
    this.#cpu = cpu;
    this.#allowSoftware = allowSoftware;
    const stored = recall();
    if (stored === "cpu" || stored === "gpu") this.#choice = stored;
  }

  get choice() {
    return this.#choice;
  }

  /** From the next extraction on. Choosing the GPU tries one again that had failed. */
  set choice(choice) {
    this.#choice = choice;
    if (choice === "gpu") this.#broken = "";
    remember(choice);
    this.#emit();
  }

  /**
   * @param {import("./extractor.js").Given} checkpoint
   * @returns {Promise<OpenEncoder>}
   */
  async open(checkpoint) {
    return new DeviceEncoder(this, checkpoint, await this.#cpu.open(checkpoint));
  }

  /**
   * Why there is no GPU to use, or "".
   * @returns {Promise<string>}
   */
  async unusable() {
    if (this.#choice === "cpu") return "as chosen";
    if (this.#broken) return this.#broken;
    this.adapter ??= await findAdapter(this.#allowSoftware);
    return this.adapter.missing ?? "";
  }

  /** Why the GPU is not tried again, or "". */
  get broken() {
    return this.#broken;
  }

  /** The worker that has the GPU; one a page, since the GPU part opens the GPU once. */
  worker() {
    this.#worker ??= new GpuWorker();
    return this.#worker;
  }

  /** @param {string} why */
  giveUp(why) {
    this.#worker?.close();
    this.#worker = null;
    this.#broken = why;
  }

  /**
   * @param {Verdict["device"]} device
   * @param {string} reason
   */
  decide(device, reason) {
    this.verdict = { device, reason };
    this.#emit();
  }

  /** @param {string} what */
  tellLoss(what) {
    this.lost = what;
    this.#emit();
  }

  #emit() {
    this.dispatchEvent(new Event("change"));
  }
}

/** @implements {OpenEncoder} */
class DeviceEncoder {
  info;
  #devices;
  #checkpoint;
  #cpu;
  /** @type {Probe | null} */
  #probe = null;

  /**
   * @param {DeviceExtractor} devices
   * @param {{ path: string, blob: Blob }} checkpoint
   * @param {OpenEncoder} cpu
   */
  constructor(devices, checkpoint, cpu) {
    this.#devices = devices;
    this.#checkpoint = checkpoint;
    this.#cpu = cpu;
    this.info = cpu.info;
  }

  free() {
    this.#cpu.free();
  }

  /** @param {Job} job */
  async extract(job) {
    const run = new Progress(job);
    const unusable = isModel(this.#checkpoint.path)
      ? "ONNX models run there"
      : await this.#devices.unusable();
    job.signal.throwIfAborted();
    if (unusable) {
      this.#devices.decide("cpu", unusable);
      return this.#onCpu(run, job.signal);
    }
    if (this.#devices.choice === "gpu") {
      this.#devices.decide("cpu", "it finds the first keypoints, for the GPU to be compared with");
      while (!this.#probe && run.samples.length === 0 && run.left > 0)
        await this.#onCpu(run, job.signal, 1);
      if (!this.#probe) await this.#compare(run, job.signal, false);
    } else if (!this.#probe || (this.#probe.agrees && this.#probe.gpu === undefined)) {
      if (await this.#contest(run)) return;
    }
    job.signal.throwIfAborted();
    await (this.#conclude() ? this.#onGpu(run) : this.#onCpu(run, job.signal));
  }

  /**
   * The CPU extracts; beside it the GPU is made ready and compared, if that is worth it. True when
   * the CPU has done it all.
   * @param {Progress} run
   */
  async #contest(run) {
    const { signal } = run.job;
    const [cpu, gpu] = [new AbortController(), new AbortController()];
    const abort = () => {
      cpu.abort(signal.reason);
      gpu.abort(signal.reason);
    };
    signal.addEventListener("abort", abort, { once: true });
    const handOver = new Error("the GPU goes on");
    this.#devices.decide("cpu", "it has begun; a GPU is looked at if there is much to do");
    void this.#compareIfWorthIt(run, gpu.signal).then(() => {
      if (gpu.signal.aborted || !(this.#probe || this.#devices.broken)) return;
      if (this.#conclude()) cpu.abort(handOver);
    });
    try {
      await this.#onCpu(run, cpu.signal);
      if (!this.#probe && !this.#devices.broken)
        this.#devices.decide("cpu", "it was done before the GPU was ready");
      return true;
    } catch (error) {
      if (error === handOver) return false;
      throw error;
    } finally {
      signal.removeEventListener("abort", abort);
      gpu.abort(new Error("the CPU is done"));
    }
  }

  /**
   * @param {Progress} run
   * @param {AbortSignal} signal
   */
  async #compareIfWorthIt(run, signal) {
    while (!signal.aborted && (run.samples.length === 0 || run.elapsed < SETTLED_MS))
      await pause(100);
    if (!signal.aborted && run.left * run.msPerFrame >= WORTH_MS)
      await this.#compare(run, signal, true);
  }

  /**
   * Looks whether the GPU finds the keypoints that the CPU found, one frame at a time and many, and
   * how fast. Whatever goes wrong is found out, not thrown.
   * @param {Progress} run
   * @param {AbortSignal} signal
   * @param {boolean} timed
   */
  async #compare(run, signal, timed) {
    const samples = [...run.samples];
    if (samples.length === 0) return;
    const count = Math.min(BATCH, run.left + samples.length);
    const batch = Array.from({ length: count }, (_, i) => samples[i % samples.length]);
    try {
      const worker = this.#devices.worker();
      await worker.open(this.#checkpoint, signal);
      /** @param {Sample[]} samples */
      const extract = async (samples) => {
        const { found, ms } = await worker.extract(
          samples.map(({ frame }) => frame),
          signal,
        );
        const differences = found.map((one, i) =>
          one ? differenceOf(one.points, samples[i].extracted.points) : Infinity,
        );
        return { ms: ms / samples.length, difference: Math.max(...differences) };
      };
      // The first time, shaders are compiled. Those of a batch may be others.
      const first = await extract(batch.slice(0, 1));
      const alone = timed ? await extract(batch.slice(0, 1)) : first;
      const cpu = run.msPerFrame;
      // A batch takes no less time than a frame.
      if (!agrees(alone.difference) || (timed && alone.ms / count >= cpu)) {
        this.#probe = {
          agrees: agrees(alone.difference),
          difference: alone.difference,
          cpu,
          gpu: alone.ms,
        };
        return;
      }
      const many = await extract(batch);
      const difference = Math.max(alone.difference, many.difference);
      this.#probe = { agrees: agrees(difference), difference };
      if (timed && this.#probe.agrees)
        Object.assign(this.#probe, { cpu: run.msPerFrame, gpu: (await extract(batch)).ms });
    } catch (error) {
      if (!signal.aborted) this.#devices.giveUp(`the GPU could not be used: ${messageOf(error)}`);
    }
  }

  /** Decides by what is known, says it, and tells whether it is the GPU. */
  #conclude() {
    const { choice, adapter } = this.#devices;
    const gpu = `the GPU (${adapter?.name})`;
    const decide = (/** @type {Verdict["device"]} */ device, /** @type {string} */ reason) => {
      this.#devices.decide(device, reason);
      return device === "gpu";
    };
    const probe = this.#probe;
    if (!probe)
      return decide(
        "cpu",
        this.#devices.broken || "no frame has keypoints to compare the GPU's with",
      );
    if (!probe.agrees) {
      const by = Number.isFinite(probe.difference)
        ? `, they differ by ${significant(probe.difference)}`
        : "";
      return decide("cpu", `${gpu} finds other keypoints on the same frame${by}: it is not used`);
    }
    const equal = `the same keypoints to ${significant(probe.difference, 1)}`;
    if (choice === "gpu") return decide("gpu", `${adapter?.name}, as chosen; ${equal}`);
    const { cpu = 0, gpu: ms = Infinity } = probe;
    const times =
      `${fixed(ms, 1)} ms a frame on the GPU (${adapter?.name}), ${fixed(cpu, 1)} ms ` +
      "on the CPU";
    return ms < cpu ? decide("gpu", `${times}; ${equal}`) : decide("cpu", times);
  }

  /**
   * @param {Progress} run
   * @param {AbortSignal} signal
   * @param {number} [most] frames
   */
  #onCpu(run, signal, most = run.left) {
    return this.#cpu.extract({
      frames: run.job.frames.slice(run.done, run.done + most),
      signal,
      onFrame: (path, extracted) => run.frame(path, extracted),
      onFailure: (path, message) => run.failure(path, message),
    });
  }

  /** @param {Progress} run */
  async #onGpu(run) {
    const { frames, signal } = run.job;
    const worker = this.#devices.worker();
    /** @type {Promise<{ found: (Extracted | null)[] }>[]} */
    const dealt = [];
    let next = run.done;
    const deal = () => {
      while (dealt.length < DEALT && next < frames.length) {
        const batch = worker.extract(frames.slice(next, (next += BATCH)), signal);
        // Told when its turn comes.
        batch.catch(() => {});
        dealt.push(batch);
      }
      return dealt.shift();
    };
    try {
      await worker.open(this.#checkpoint, signal);
    } catch (error) {
      return this.#afterLoss(run, error);
    }
    for (let batch = deal(); batch; batch = deal()) {
      let found;
      try {
        ({ found } = await batch);
      } catch (error) {
        return this.#afterLoss(run, error);
      }
      for (const extracted of found) {
        if (extracted) run.frame(frames[run.done].path, extracted);
        else await this.#onCpu(run, signal, 1);
      }
    }
  }

  /**
   * The CPU goes on where the GPU failed.
   * @param {Progress} run
   * @param {unknown} error
   */
  async #afterLoss(run, error) {
    run.job.signal.throwIfAborted();
    const why = `the GPU was lost: ${messageOf(error)}`;
    this.#devices.giveUp(why);
    this.#devices.decide("cpu", why);
    this.#devices.tellLoss(
      `In the middle of the extraction ${why}. The CPU went on from the next frame; nothing is ` +
        "missing.",
    );
    await this.#onCpu(run, run.job.signal);
  }
}

/** How far a job has come. */
class Progress {
  done = 0;
  /** The first frames that were done. @type {Sample[]} */
  samples = [];
  /** When the last frames were done, the newest last. @type {number[]} */
  #times = [];
  #start = 0;

  /** @param {Job} job */
  constructor(job) {
    this.job = job;
  }

  get left() {
    return this.job.frames.length - this.done;
  }

  /** Milliseconds since the first frame. */
  get elapsed() {
    return performance.now() - this.#start;
  }

  /** Of the last frames: at first, workers are still being started. */
  get msPerFrame() {
    const times = this.#times;
    return (times[times.length - 1] - times[0]) / Math.max(1, times.length - 1);
  }

  /**
   * @param {string} path
   * @param {Extracted} extracted
   */
  frame(path, extracted) {
    if (this.samples.length < BATCH)
      this.samples.push({ frame: this.job.frames[this.done], extracted });
    this.#count();
    this.job.onFrame(path, extracted);
  }

  /**
   * @param {string} path
   * @param {string} message
   */
  failure(path, message) {
    this.#count();
    this.job.onFailure(path, message);
  }

  #count() {
    const now = performance.now();
    if (this.done++ === 0) this.#start = now;
    this.#times.push(now);
    if (this.#times.length > RECENT) this.#times.shift();
  }
}

/** @param {number} difference */
function agrees(difference) {
  return difference <= AGREEMENT;
}

/**
 * The largest one of any coordinate.
 * @param {Float64Array} a
 * @param {Float64Array} b
 */
function differenceOf(a, b) {
  if (a.length !== b.length) return Infinity;
  return a.reduce((largest, value, i) => Math.max(largest, Math.abs(value - b[i])), 0);
}

/** @param {number} ms */
function pause(ms) {
  return new Promise((resolve) => setTimeout(resolve, ms));
}

function recall() {
  try {
    return localStorage.getItem(STORED);
  } catch {
    return null;
  }
}

/** @param {Choice} choice */
function remember(choice) {
  try {
    localStorage.setItem(STORED, choice);
  } catch {
    // Forgotten with the page.
  }
}
