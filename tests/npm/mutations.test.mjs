// Mutated calls of every function of the package under Node.js: whatever the arguments are, a call
// returns or throws an error in words, within its time. It never traps, which leaves a module that
// nothing can be called in any more, and never hangs.
//
// The same calls every time; TRACKLENS_CALLS is another number of them, TRACKLENS_SEED another seed.
import assert from "node:assert/strict";
import { readFile, readdir } from "node:fs/promises";
import { test } from "node:test";
import { Worker, isMainThread, parentPort, workerData } from "node:worker_threads";

const CALLS = Number(process.env.TRACKLENS_CALLS ?? 1500);
const SEED = Number(process.env.TRACKLENS_SEED ?? 1);
/** Milliseconds that a call may take, on a machine that does many things at a time. */
const PATIENCE = 300_000;
/** Characters of a call that are told. */
const SHOWN = 2000;

/** Numbers from 0 to 1, the same for a seed. @param {number} seed */
function random(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
}

const ODD = [
  undefined,
  null,
  true,
  "",
  "\0",
  "a".repeat(70_000),
  "\ud800",
  "__proto__",
  NaN,
  Infinity,
  -Infinity,
  -1,
  -0.5,
  0,
  1,
  0.1,
  3,
  255,
  65_537,
  2 ** 31,
  2 ** 32,
  2 ** 53,
  1e-320,
  1e-100,
  1e100,
  1e308,
  -1e308,
  [],
  {},
  [[]],
  new Uint8Array(),
  new Uint8Array(100_000),
  new Float64Array([NaN, 1e308, -1e308, 1e-320]),
  new Float64Array(5000),
  new Uint32Array([0, 1, 2 ** 32 - 1]),
  new Int32Array([-1, 2 ** 31 - 1]),
  10n,
  Symbol.iterator,
  () => 1,
];

/** A copy of objects and lists; whatever else is in them stays what it is. @param {any} value */
function copied(value) {
  if (Array.isArray(value)) return value.map(copied);
  if (value?.constructor !== Object) return value;
  return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, copied(inner)]));
}

/** Ways to change what a function is usually called with. */
class Mutator {
  /** @param {() => number} next */
  constructor(next) {
    this.next = next;
  }

  /** @param {number} below */
  below(below) {
    return Math.floor(this.next() * below);
  }

  /** @template T @param {T[]} all */
  pick(all) {
    return all[this.below(all.length)];
  }

  odd() {
    return this.pick(ODD);
  }

  /** @param {unknown} value */
  change(value) {
    const dice = this.next();
    if (dice < 0.3) return this.odd();
    if (value instanceof Uint8Array) return this.bytes(value);
    if (ArrayBuffer.isView(value)) return this.numbers(/** @type {any} */ (value));
    if (typeof value === "number") return this.number(value);
    if (typeof value === "string") return this.text(value);
    if (Array.isArray(value) || value?.constructor === Object) return this.structure(value);
    return dice < 0.5 ? this.odd() : value;
  }

  /** @param {Uint8Array} bytes */
  bytes(bytes) {
    const copy = bytes.slice(0, this.next() < 0.2 ? this.below(bytes.length + 1) : undefined);
    for (let i = 1 + this.below(8); i > 0 && copy.length > 0; i--) {
      const at = this.below(copy.length);
      const byte = this.pick([0, 0xff, 0x7f, 0x80, 0x2c, 0x0a, 0x39, this.below(256)]);
      copy[at] = this.next() < 0.5 ? byte : copy[at] ^ (1 << this.below(8));
    }
    if (this.next() < 0.2 && copy.length > 1) {
      const [from, to] = [this.below(copy.length), this.below(copy.length)];
      copy.copyWithin(to, from, from + this.below(64));
    }
    return copy;
  }

  /** @param {Float64Array | BigUint64Array} numbers */
  numbers(numbers) {
    const copy = numbers.slice(0, this.next() < 0.3 ? this.below(numbers.length + 1) : undefined);
    const extremes = [NaN, Infinity, -Infinity, 1e308, -1e308, 1e-320, 0, -1];
    const whole = [0n, 1n, 2n ** 53n + 1n, 2n ** 64n - 1n];
    const value = this.pick(copy instanceof BigUint64Array ? whole : extremes);
    if (copy.length > 0) copy[this.below(copy.length)] = value;
    return copy;
  }

  /** @param {number} number */
  number(number) {
    return this.pick([-number, number + 1, number - 1, number / 3, number * 1e6, number * 1e300]);
  }

  /** @param {string} text */
  text(text) {
    const at = this.below(text.length + 1);
    const more = this.pick(["\u0000", "\u001b[31m", "=", ",", "\n", "../", "é", "😀", "%", '"']);
    return this.next() < 0.7 ? text.slice(0, at) + more + text.slice(at) : text.slice(at);
  }

  /**
   * One place of an object or a list, at any depth.
   * @param {any} value
   */
  structure(value) {
    const copy = copied(value);
    let inside = copy;
    for (;;) {
      const keys = Object.keys(inside);
      if (keys.length === 0) {
        if (Array.isArray(inside)) inside.push(this.odd());
        else inside[this.pick(["a", "tc", "levels", "width"])] = this.odd();
        return copy;
      }
      const key = this.pick(keys);
      const next = inside[key];
      const isDeep = Array.isArray(next) || next?.constructor === Object;
      if (isDeep && this.next() < 0.75) {
        inside = next;
        continue;
      }
      if (this.next() < 0.15) delete inside[key];
      else if (this.next() < 0.1 && Array.isArray(inside)) inside.push(...inside);
      else inside[key] = this.change(next);
      return copy;
    }
  }
}

const data = new URL("../data/", import.meta.url);
const golden = (/** @type {string} */ name) =>
  readFile(new URL(`../golden/${name}`, import.meta.url)).then((bytes) => new Uint8Array(bytes));
const read = (/** @type {string} */ path) =>
  readFile(new URL(path, data)).then((bytes) => new Uint8Array(bytes));
const utf8 = (/** @type {string} */ text) => new TextEncoder().encode(text);

/** Two sequences of an object and a keypoint, with confidences. */
function tables() {
  let truth = "sequence,frame,object,x,y,visible\n";
  let keypoints = "sequence,frame,keypoint,x,y,likelihood\n";
  for (let t = 0; t < 60; t++) {
    const [x, y] = [0.8 * Math.sin(t), 0.8 * Math.cos(1.7 * t)];
    const [sequence, frame] = [t % 2, Math.floor(t / 2)];
    truth += `${sequence},${frame},cube,${x},${y},1\n${sequence},${frame},eef,${-y},${x},1\n`;
    keypoints += `${sequence},${frame},0,${y},${x},${(t % 10) / 10}\n`;
    keypoints += `${sequence},${frame},1,${x * y},${t % 7 ? x : ""},0.5\n`;
  }
  return { truth: utf8(truth), keypoints: utf8(keypoints) };
}

/** An archive with one stored entry. */
function archive() {
  const name = utf8("a.csv");
  const head = [0x50, 0x4b, 3, 4, 20, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
  const local = [...head, name.length, 0, 0, 0, ...name];
  const central = [0x50, 0x4b, 1, 2, 20, 0, 20, ...Array(21).fill(0), name.length, ...Array(17).fill(0), ...name];
  const end = [0x50, 0x4b, 5, 6, 0, 0, 0, 0, 1, 0, 1, 0, central.length, 0, 0, 0, local.length, 0, 0, 0, 0, 0];
  return new Uint8Array([...local, ...central, ...end]);
}

/**
 * Every function with the arguments that it is usually called with. Objects of the package are made
 * anew for a call: one that was mutated must not spoil another call.
 * @param {typeof import("../../pkg/node.js")} t
 */
async function calls(t) {
  const { truth, keypoints } = tables();
  const makeTruth = () => t.GroundTruthTable.parse(truth, "gt.csv");
  const makeKeypoints = () => t.KeypointTable.parse(keypoints, "kp.csv");
  const makeScoring = () => new t.Scoring(makeTruth(), makeKeypoints());
  const sequence = (await readdir(new URL("panda_push/seq_0000/", data))).map((file) => `seq_0000/${file}`);
  const makeFrames = () => new t.FrameIndex(sequence);
  const frame = await read(`panda_push/${sequence[0]}`);
  const photos = await readdir(new URL("photos/seq_0000/", data));
  const photo = await read(`photos/seq_0000/${photos.find((name) => name.endsWith(".webp"))}`);
  const weights = await Promise.all(
    ["basic-vel-std-bg-tiny.safetensors", "basic-vel-std-bg-tiny.pth", "keynet-vel-std-bg-tiny.safetensors"].map(golden),
  );
  const makeEncoder = () => new t.Encoder(weights[0], "tiny.safetensors");
  const config = makeEncoder().info.config;
  const model = await read("onnx/points.onnx");
  const settings = JSON.stringify(JSON.parse(await readFile(new URL("onnx/expected.json", data), "utf8")).points.settings);
  const makeDetector = () => new t.Detector(model, "a.onnx", settings);
  const options = {
    ...{ transform: "affine", rank: "reference", thresholds: { cube: 0.1 }, imageSize: [64, 48], folds: 2, bootstrap: 3 },
    ...{ seed: 1, sequences: true, context: true, confidenceLevels: [0.2, 0.5] },
  };
  const full = makeScoring().evaluate(options);
  const json = utf8(JSON.stringify(full));
  const theme = {
    ...{ foreground: "#000000", muted: "#777777", background: "#ffffff", grid: "#dddddd", good: "#00aa00" },
    ...{ bad: "#aa0000", accent: "#0000aa", fontSize: 13 },
  };
  const lines = {
    ...{ title: "x", xLabel: "frame", yLabel: "x", start: 0, cursor: 1, fromZero: false, fontSize: 12 },
    ...{ foreground: "#000000", background: "#ffffff", grid: "#dddddd" },
    series: [{ label: "a", color: "#ff0000", values: new Float64Array([0, 1, NaN, 0.5]) }],
  };
  const film = {
    ...{ sequence: "0", length: 3, size: [64, 48], frames: [0, 1], images: ["data:image/png;base64,AA==", null] },
    tracks: [{ object: "cube", keypoint: 0, truth: [[0, 0.5], null], mapped: [[0.1, 0.5], [NaN, 1e308]] }],
  };
  const inputs = { truth: "gt.csv", keypoints: "kp.csv", options: ["--space", "px"] };
  const table = { space: "px", axisOrder: "yx", indexBase: 0, imageSize: [64, 48] };
  const points = await read("formats/points.npz");
  const npy = arrayIn(points);
  const frameArray = arrayIn(await read("formats/frames.npz"));
  const arrays = () => {
    const made = new t.Arrays("points.npz");
    made.add("keypoints", npy, npy.length);
    made.add("frames", frameArray, frameArray.length);
    return made;
  };
  const trained = new URL("../../docs/example-run/", import.meta.url);
  const part = async (/** @type {string} */ name) => new Uint8Array(await readFile(new URL(name, trained)));
  const run = {
    config: await part("config.json"),
    log: await part("log.jsonl"),
    summary: await part("summary.json"),
  };
  const comparison = () => {
    const made = new t.Comparison();
    made.addEvaluation("one", full, "a");
    made.addEvaluation("two", full, "b");
    return made;
  };
  const everything = (/** @type {any} */ thing) => {
    for (let at = thing; at && at !== Object.prototype; at = Object.getPrototypeOf(at)) {
      for (const [name, { get }] of Object.entries(Object.getOwnPropertyDescriptors(at)))
        if (get && name !== "__proto__") void thing[name];
    }
    return thing;
  };
  const of = (/** @type {() => any} */ make, /** @type {string} */ method) => (/** @type {unknown[]} */ ...given) =>
    everything(make())[method](...given);
  /** @type {[string, (...given: any[]) => unknown, unknown[]][]} */
  const all = [
    ["classify", t.classify, ["a/b.csv", truth]],
    ["needsDecoding", t.needsDecoding, [photo]],
    ["needsFormats", t.needsFormats, [frame]],
    ["readPoints of a table", t.readPoints, [await read("../public/files/dlc-table.h5"), "a.h5"]],
    ["readPoints of arrays", t.readPoints, [await read("../public/files/sleap.analysis.h5"), "a.h5"]],
    ["readPoints of a project", t.readPoints, [await read("../public/files/sleap.slp"), "a.slp"]],
    ["readPoints of a pickle", t.readPoints, [await read("../public/files/tap-vid-4.pkl"), "a.pkl"]],
    ["GroundTruthTable.parse", (...a) => everything(t.GroundTruthTable.parse(...a)), [truth, "gt.csv", table]],
    ["KeypointTable.parse", (...a) => everything(t.KeypointTable.parse(...a)).toCsv(), [keypoints, "kp.csv", table]],
    ["KeypointTable.fromExtraction", (...a) => t.KeypointTable.fromExtraction(...a).toCsv(), [makeFrames(), new Float64Array(2 * sequence.length), 1]],
    ["FrameIndex", (...a) => everything(new t.FrameIndex(...a)), [sequence]],
    ["FrameIndex.ofAll", (...a) => everything(t.FrameIndex.ofAll(...a)), [sequence]],
    ["FrameIndex.select", of(makeFrames, "select"), [new Uint32Array([0, 1])]],
    ["readArchive", t.readArchive, [archive(), archive().length, "a.zip"]],
    ["Arrays.uses", t.Arrays.uses, ["keypoints"]],
    ["Arrays.bytesNeeded", t.Arrays.bytesNeeded, ["images", 1000]],
    ["Arrays.add", (...a) => { const made = new t.Arrays("a"); made.add(...a); return made.keypoints(); }, ["keypoints", npy, npy.length]],
    ["mapColumns", t.mapColumns, [truth, "a.csv", ["x", "sequence"], ["y", ""], false]],
    ["Arrays.frames", of(arrays, "frames"), []],
    ["Arrays.groundTruth", of(arrays, "groundTruth"), [table]],
    ["Arrays.keypoints", of(arrays, "keypoints"), [table]],
    ["joinFrames", t.joinFrames, [makeFrames(), makeTruth()]],
    ["latentToImage", t.latentToImage, [config, new Float64Array([0, 1, -1, 0.5]), 64, 48]],
    ["Encoder", (...a) => everything(new t.Encoder(...a)), [weights[0], "a.safetensors"]],
    ["Encoder of a pickle", (...a) => everything(new t.Encoder(...a)), [weights[1], "a.pth"]],
    ["Encoder.extract", of(makeEncoder, "extract"), [frame, "a.png"]],
    ["Encoder.heatMap", of(makeEncoder, "heatMap"), [frame, "a.png", 1]],
    ["Decoder.open", (...a) => everything(t.Decoder.open(...a))?.reconstruct(new Float64Array(10)), [weights[2], "a.safetensors"]],
    ["Decoder.reconstruct", of(() => t.Decoder.open(weights[0], "a"), "reconstruct"), [new Float64Array(8)]],
    ["Detector", (...a) => everything(new t.Detector(...a)), [model, "a.onnx", settings]],
    ["Detector.extract", (...a) => everything(makeDetector().extract(...a)), [frame, "a.png"]],
    ["imageToArray", t.imageToArray, [photo, "a.webp"]],
    ["parseEvaluation", t.parseEvaluation, [json, "e.json"]],
    ["evaluationPage", t.evaluationPage, [full, film]],
    ["evaluationCsv", t.evaluationCsv, [full]],
    ["temporalQuality", t.temporalQuality, [makeTruth().toObject(), makeKeypoints().toObject(), {}, {}, options]],
    ["temporalTable", t.temporalTable, [{ ...full, temporal: { folds: 2, measures: [{ measure: "lag", objects: [1, null], all: null }] } }]],
    ["Scoring", (...a) => everything(new t.Scoring(...a)).evaluate(), [makeTruth(), makeKeypoints(), "exclude-point", { keypoints: 0.2, truth: 0 }]],
    ["Scoring of odd tables", (a, b) => new t.Scoring(t.GroundTruthTable.parse(a, "a"), t.KeypointTable.parse(b, "b")).evaluate(options), [truth, keypoints]],
    ["Scoring.imagesFrom", of(makeScoring, "imagesFrom"), [makeFrames()]],
    ["Scoring.evaluate", of(makeScoring, "evaluate"), [options]],
    ["Scoring.sequenceErrors", of(makeScoring, "sequenceErrors"), [0, 0, { transform: "affine" }]],
    ["Scoring.distances", of(makeScoring, "distances"), [0, 0, { transform: "affine" }]],
    ["Scoring.keypointsAt", of(makeScoring, "keypointsAt"), [3]],
    ["Scoring.series", of(makeScoring, "series"), [0, 0, { rank: "centred" }]],
    ["Scoring.bootstrap", of(makeScoring, "bootstrap"), [options]],
    ["Bootstrap.draw", (draws) => { const made = makeScoring().bootstrap({}); made.draw(draws < 1000 ? draws : 3); return made.intervals(); }, [2]],
    ["Scoring.command", of(makeScoring, "command"), [inputs, options]],
    ["matrixFigure", t.matrixFigure, [full, new Int32Array([0, 1]), theme, 600]],
    ["capabilityFigure", t.capabilityFigure, [full, 2, theme, 600]],
    ["confidenceFigure", t.confidenceFigure, [full, theme, 600]],
    ["sequencesFigure", t.sequencesFigure, [new Float64Array([0.2, 0.1]), 0.15, 1, theme, 600]],
    ["linesToSvg", t.linesToSvg, [lines, 600, 300]],
    ["findRuns", t.findRuns, [["a/config.json", "a/log.jsonl", "b.csv"]]],
    ["Comparison.addRun", (...a) => { const made = new t.Comparison(); made.addRun(...a); return everything(made).compare(); }, ["a", run]],
    ["Comparison.addEvaluation", (...a) => { const made = new t.Comparison(); made.addEvaluation(...a); return everything(everything(made).compare()).toHtml(); }, ["a", full, "x"]],
    ["Comparison.compare", (...a) => { const made = everything(comparison().compare(...a)); return [made.toHtml(), made.toMarkdown(), made.runsCsv(), made.errorsCsv()]; }, [{}]],
  ];
  return all;
}

/** The first array in an NPZ file of stored arrays. @param {Uint8Array} npz */
function arrayIn(npz) {
  const start = npz.findIndex((_, i) => npz[i] === 0x93 && npz[i + 1] === 0x4e);
  const end = npz.findIndex((_, i) => i > start && npz[i] === 0x50 && npz[i + 1] === 0x4b);
  return npz.slice(start, end);
}

/** What an error in words never is; an offset in a file may well be out of bounds. */
const TRAP = /unreachable|(access|index)( is)? out of bounds|null pointer passed|recursive use|panicked|RuntimeError|stack size/;

/** @param {unknown[]} given */
function shown(given) {
  const plain = (/** @type {string} */ _, /** @type {any} */ value) =>
    ArrayBuffer.isView(value) ? `${value.constructor.name} ${[.../** @type {any} */ (value).slice(0, 400)]}`
    : typeof value === "bigint" || typeof value === "symbol" || typeof value === "function" ? String(value)
    : Number.isNaN(value) ? "NaN" : value;
  return JSON.stringify(given, plain)?.slice(0, SHOWN) ?? "";
}

async function work() {
  const { seed, calls: count } = workerData;
  const package_ = await import("../../pkg/node.js");
  await package_.default();
  const all = await calls(package_);
  const next = random(seed);
  const mutate = new Mutator(next);
  const [returned, threw] = [new Set(), new Set()];
  for (const [name, call, usual] of all) {
    call(...usual);
    returned.add(name);
  }
  for (let i = 0; i < count; i++) {
    const [name, call, usual] = mutate.pick(all);
    const given = [...usual];
    for (let changes = 1 + mutate.below(2); changes > 0; changes--) {
      const at = mutate.below(Math.max(1, given.length));
      given[at] = mutate.change(given[at]);
    }
    if (i % 20 === 0 || count <= 2000) parentPort?.postMessage({ at: i, call: `${name}(${shown(given)})` });
    try {
      call(...given);
      returned.add(name);
    } catch (error) {
      threw.add(name);
      const text = String(/** @type {any} */ (error)?.message ?? error);
      if (error instanceof WebAssembly.RuntimeError || TRAP.test(text)) {
        throw new Error(`call ${i} of seed ${seed}: ${name}(${shown(given)}) traps: ${text}`);
      }
    }
  }
  parentPort?.postMessage({ done: true, functions: all.length, returned: returned.size, threw: threw.size });
}

if (isMainThread) {
  test(`${CALLS} mutated calls neither trap nor hang`, async () => {
    const done = await new Promise((resolve, reject) => {
      const worker = new Worker(new URL(import.meta.url), { workerData: { seed: SEED, calls: CALLS } });
      let last = "the start";
      const timer = () =>
        setTimeout(() => {
          void worker.terminate();
          reject(new Error(`no call returns within ${PATIENCE / 1000} s: ${last}`));
        }, PATIENCE);
      let patience = timer();
      worker.on("message", (message) => {
        clearTimeout(patience);
        patience = timer();
        if (message.done) {
          clearTimeout(patience);
          resolve(message);
        } else last = `call ${message.at}, ${message.call}`;
      });
      worker.on("error", (error) => {
        clearTimeout(patience);
        reject(error);
      });
    });
    assert.equal(done.returned, done.functions, "every function returns for some arguments");
    assert.ok(done.threw > done.functions / 2, "most refuse some arguments");
  });
} else {
  await work();
}
