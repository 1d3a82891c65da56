// The npm package under Node.js, on real files.
import assert from "node:assert/strict";
import { readFile, readdir } from "node:fs/promises";
import { before, test } from "node:test";
import { Worker } from "node:worker_threads";
import { gzipSync } from "node:zlib";

import init, * as tracklens from "../../pkg/node.js";

const data = new URL("../data/panda_push/", import.meta.url);
const read = (path) => readFile(new URL(path, data));
const golden = (name) => readFile(new URL(`../golden/${name}`, import.meta.url));

before(() => init());

async function paths() {
  const found = ["ground_truth.csv"];
  for (const sequence of ["seq_0012", "seq_0000", "seq_0001"]) {
    for (const file of await readdir(new URL(sequence, data))) found.push(`${sequence}/${file}`);
  }
  return found;
}

async function extractAll() {
  const all = await paths();
  const frames = new tracklens.FrameIndex(all);
  const encoder = new tracklens.Encoder(await golden("basic-vel-std-bg-tiny.safetensors"), "tiny.safetensors");
  const points = [];
  for (const i of frames.order) points.push(...encoder.extract(await read(all[i]), all[i]).points);
  const table = tracklens.KeypointTable.fromExtraction(frames, new Float64Array(points), encoder.info.keypoints);
  return { frames, encoder, table };
}

test("frames, a checkpoint and a table make an evaluation", async () => {
  const { frames, encoder, table } = await extractAll();
  assert.equal(frames.length, 15);
  assert.deepEqual(frames.sequences[1], { name: "seq_0001", start: 5, length: 5 });
  assert.deepEqual(frames.ignored, ["ground_truth.csv"]);
  assert.equal(encoder.info.architecture, "basic-kp4-std-bg");
  assert.equal(encoder.info.inputSize, null);

  const truth = tracklens.GroundTruthTable.parse(await read("ground_truth.csv"), "ground_truth.csv");
  assert.deepEqual(truth.objects, ["cube", "target", "eef"]);
  assert.equal(tracklens.joinFrames(frames, truth).matched, 15);

  const scoring = new tracklens.Scoring(truth, table);
  const evaluation = scoring.evaluate({ imageSize: [256, 256], thresholds: { cube: 1e-9 } });
  assert.equal(evaluation.schema, "tracklens/evaluation/3");
  assert.equal(evaluation.frames, 15);
  assert.equal(evaluation.objects[0].tracked, false);
  assert.equal(evaluation.errors.length, 3);
  assert.equal(evaluation.errors[0].length, 4);
  assert.deepEqual([...scoring.imagesFrom(frames)], [...Array(15).keys()]);

  // The error is the mean squared distance between the transformed keypoint and the truth.
  const { best_keypoint: best, error } = evaluation.objects[2];
  const series = scoring.series(2, best);
  const { truth: x, transformed: z } = series;
  const mean = x.reduce((sum, value, i) => sum + (value - z[i]) ** 2, 0) / 15;
  const near = (value) => assert.ok(Math.abs(value - error) < 1e-12 + 1e-9 * error, `${value} and ${error}`);
  near(mean);
  near(scoring.distances(2, best).reduce((sum, value) => sum + value, 0) / 15);
  // All three sequences have five frames.
  near(scoring.sequenceErrors(2, best).reduce((sum, { error }) => sum + error, 0) / 3);

  // A frame's keypoints, and the weights that one of them is the mean position of.
  const points = scoring.keypointsAt(7);
  assert.deepEqual([...points.slice(2 * best, 2 * best + 2)], [...series.keypoint.slice(14, 16)]);
  assert.throws(() => scoring.keypointsAt(15), /there is no frame 15/);
  const path = (await paths())[frames.order[7]];
  const map = encoder.heatMap(await read(path), path, best);
  const column = (_, i) => (2 * (i % map.width)) / (map.width - 1) - 1;
  const mean_x = map.weights.reduce((sum, weight, i) => sum + weight * column(weight, i), 0);
  assert.equal(map.weights.length, map.width * map.height);
  assert.ok(Math.abs(mean_x - points[2 * best]) < 1e-6);

  // And the image that the decoder makes of all of them.
  assert.equal(encoder.info.decoder, true);
  const decoder = tracklens.Decoder.open(await golden("basic-vel-std-bg-tiny.safetensors"), "tiny.safetensors");
  const image = decoder.reconstruct(points);
  assert.equal(image.length, 4 * decoder.width * decoder.height);
  assert.ok(image.every((value, i) => i % 4 !== 3 || value === 255) && image.some((value, i) => i % 4 !== 3 && value > 0));
  assert.throws(() => decoder.reconstruct(points.slice(2)), /keypoints for a decoder of/);
});

test("a checkpoint of the authors' code is read as it is", async () => {
  const bytes = await golden("basic-vel-std-bg-tiny.pth");
  const encoder = new tracklens.Encoder(bytes, "checkpoint_final.pth");
  assert.equal(encoder.info.architecture, "basic-kp4-vel-std-bg");
  assert.equal(encoder.info.metadata.epoch, "499");
  assert.equal(JSON.parse(encoder.info.metadata.cfg).training.learning_rate, 0.001);
  const same = new tracklens.Encoder(await golden("basic-vel-std-bg-tiny.safetensors"), "w");
  const frame = await read("seq_0000/frame_000.png");
  assert.deepEqual(encoder.extract(frame, "f").points, same.extract(frame, "f").points);
  const wrong = (bytes, message) =>
    assert.throws(() => new tracklens.Encoder(bytes, "w.pth"), (error) => error.kind === "input" && message.test(error.message));
  wrong(bytes.subarray(0, 30000), /w\.pth: not a complete \.pth file \(30000 bytes/);
  wrong(new Uint8Array([0x80, 2, 0x8a, 10]), /w\.pth: a pickle that torch\.save did not write/);
});

test("a keypoint table survives the way through CSV", async () => {
  const { table } = await extractAll();
  const bytes = new TextEncoder().encode(table.toCsv());
  const again = tracklens.KeypointTable.parse(bytes, "kp.csv");
  assert.equal(again.toCsv(), table.toCsv());
  assert.deepEqual([again.frames, again.keypoints], [15, 4]);
});

test("JPEG and WebP images are decoded by a part of their own", async () => {
  const photos = new URL("../data/photos/seq_0000/", import.meta.url);
  const encoder = new tracklens.Encoder(await golden("basic-vel-std-bg-tiny.safetensors"), "tiny.safetensors");
  for (const name of ["frame_000.jpg", "frame_001.jpg", "frame_002.webp", "frame_003.webp"]) {
    const image = await readFile(new URL(name, photos));
    assert.ok(tracklens.needsDecoding(image), name);
    assert.throws(() => encoder.extract(image, name), /cannot be decoded .*imageToArray/);
    const found = encoder.extract(tracklens.imageToArray(image, name), name);
    assert.deepEqual([found.width, found.height], [128, 128]);
    assert.throws(() => tracklens.imageToArray(image.subarray(0, 300), "cut"), /cut: .*is the file complete/);
  }
  const png = await readFile(new URL("frame_004.png", photos));
  assert.ok(!tracklens.needsDecoding(png));
  const points = (image) => encoder.extract(image, "frame_004.png").points;
  assert.deepEqual(points(tracklens.imageToArray(png, "frame_004.png")), points(png));
});

test("errors are JavaScript errors with the same text", async () => {
  const utf8 = (text) => new TextEncoder().encode(text);
  const kind = (kind, message) => (error) => error instanceof Error && error.kind === kind && message.test(error.message);
  assert.throws(
    () => tracklens.GroundTruthTable.parse(utf8("sequence,frame,object,x\n0,0,cube,1\n"), "gt.csv"),
    kind("input", /gt\.csv: line 1: column `y` missing; expected `sequence,frame,object,x,y`/),
  );
  const weights = await golden("basic-vel-std-bg-tiny.safetensors");
  assert.throws(() => new tracklens.Encoder(weights.subarray(0, 999), "w"), kind("input", /w: not a complete/));
  const encoder = new tracklens.Encoder(weights, "w");
  const png = await read("seq_0000/frame_000.png");
  assert.throws(() => encoder.extract(png.subarray(0, 3000), "cut.png"), kind("input", /cut\.png: .*cannot be decoded/));
  assert.throws(() => new tracklens.FrameIndex(["a.txt"]), kind("input", /no images among 1 file/));
  const truth = tracklens.GroundTruthTable.parse(await read("ground_truth.csv"), "gt.csv");
  const other = tracklens.KeypointTable.parse(utf8("sequence,frame,keypoint,x,y\nzz,0,0,1,1\nyy,0,0,1,1\n"), "kp.csv");
  assert.throws(() => new tracklens.Scoring(truth, other), kind("mismatch", /no frame has a row of ground truth/));
  const { table } = await extractAll();
  const scoring = new tracklens.Scoring(truth, table);
  assert.throws(() => scoring.evaluate({ transform: "projective" }), kind("input", /expected one of identity/));
  assert.throws(() => scoring.evaluate({ tresholds: {} }), kind("input", /unknown field/));
  assert.throws(() => scoring.series(7, 0), kind("input", /there is no object 7/));
  // Nothing broke: the module still works.
  assert.equal(scoring.evaluate().frames, 15);
});

test("files are recognised", () => {
  const role = (path, head) => tracklens.classify(path, new TextEncoder().encode(head)).role;
  assert.equal(role("a/b.png", ""), "image");
  assert.equal(role("gt.csv", "sequence,frame,object,x,y\n"), "ground-truth");
  assert.equal(role("kp.csv", "sequence,frame,keypoint,x,y\n"), "keypoints");
  assert.equal(role("x.safetensors", ""), "checkpoint");
  assert.equal(role("x.pth", ""), "checkpoint");
  assert.equal(role("x.bpk", ""), "checkpoint");
  assert.equal(role("x.docx", ""), "unknown");
  assert.equal(role("x.npz", ""), "recording");
  assert.equal(role("x.zip", ""), "archive");
  assert.equal(role("x.mp4", ""), "video");
  assert.equal(role("r.json", '{ "schema": "tracklens/evaluation/1" }'), "result");
  const wide = tracklens.classify("t.csv", new TextEncoder().encode("frame,a_x,a_y\n"));
  assert.deepEqual([wide.role, wide.guess], ["ground-truth", true]);
});

test("a figure is an SVG document", () => {
  const hex = { foreground: "#222222", background: "#ffffff", grid: "#dddddd" };
  const series = [{ label: "truth", color: "#000000", values: new Float64Array([0, 1, NaN, 0.5]) }];
  const figure = { title: "", xLabel: "frame", yLabel: "x", start: 0, series, cursor: 1, fontSize: 12, ...hex };
  const svg = tracklens.linesToSvg(figure, 400, 200);
  assert.match(svg, /^<svg/);
  assert.throws(() => tracklens.linesToSvg({ ...figure, grid: "red" }, 400, 200), /#rrggbb/);
});

test("tables in pixels are read with the size of their images", () => {
  const text = "frame,cube_x,cube_y\n0,0,0\n1,199,99\n";
  const bytes = new TextEncoder().encode(text);
  const options = { space: "px", imageSize: [200, 100] };
  const table = tracklens.GroundTruthTable.parse(bytes, "push.csv", options);
  assert.deepEqual(table.objects, ["cube"]);
  assert.throws(
    () => tracklens.GroundTruthTable.parse(bytes, "push.csv", { space: "px" }),
    /push\.csv: the positions are in pixels/,
  );
  assert.throws(() => tracklens.GroundTruthTable.parse(bytes, "push.csv", { size: [1, 1] }), /size/);
});

test("an evaluation can be asked for more, drawn, written and read again", async () => {
  const { table } = await extractAll();
  const truth = tracklens.GroundTruthTable.parse(await read("ground_truth.csv"), "ground_truth.csv");
  const scoring = new tracklens.Scoring(truth, table);
  const plain = scoring.evaluate();
  assert.equal(plain.sequences, undefined);
  const options = { folds: 3, bootstrap: 30, seed: 7, sequences: true, context: true, imageSize: [256, 256] };
  const evaluation = scoring.evaluate(options);
  assert.deepEqual(evaluation.errors, plain.errors);
  assert.equal(evaluation.held_out.folds, 3);
  assert.deepEqual(evaluation.image_size, [256, 256]);

  // In steps as at once.
  const steps = scoring.bootstrap(options);
  for (const count of [1, 9, 20]) steps.draw(count);
  assert.deepEqual(steps.intervals(), evaluation.intervals);

  const best = evaluation.objects[0].best_keypoint;
  const distances = scoring.distances(0, best);
  const mean = distances.reduce((sum, value) => sum + value, 0) / distances.length;
  assert.ok(Math.abs(mean - evaluation.objects[0].error) < 1e-9 * mean);
  const [worst] = scoring.sequenceErrors(0, best);
  assert.equal(distances[worst.worst], worst.worstError);
  assert.equal(worst.worstFrame, scoring.frameNumbers[worst.worst]);
  assert.equal(worst.error, evaluation.sequences[0].errors[0].error);

  const saved = new TextEncoder().encode(JSON.stringify(evaluation));
  assert.deepEqual(tracklens.parseEvaluation(saved, "evaluation.json"), evaluation);
  const newer = new TextEncoder().encode(JSON.stringify({ ...evaluation, schema: "tracklens/evaluation/9" }));
  assert.throws(() => tracklens.parseEvaluation(newer, "e.json"), /e\.json: .*evaluation\/9.*reads up to/);

  const report = tracklens.evaluationPage(evaluation);
  assert.match(report, /^<!DOCTYPE html>/);
  assert.doesNotMatch(report, /film-frame/);
  const film = {
    ...{ sequence: "0", length: 3, size: [64, 48], frames: [0, 1], images: ["data:image/png;base64,AA==", null] },
    tracks: [{ object: "cube", keypoint: 0, truth: [[0, 0.5], null], mapped: [null, [0.1, 0.5]] }],
  };
  assert.match(tracklens.evaluationPage(evaluation, film), /class="film-frame"[^]*: 2 of 3 frames/);
  const inSpace = [{ object: "cube", keypoint: 0, truth: [[0, 0.5, 9], [1, 1, 8]], mapped: [null, [0, 1, 2]] }];
  const plotted = tracklens.evaluationPage(evaluation, { ...film, images: [], tracks: inSpace });
  assert.match(plotted, /2 of 3 frames, in the unit of the ground truth/);
  assert.throws(() => tracklens.evaluationPage(evaluation, { ...film, frames: "all" }), /the film: /);
  assert.match(tracklens.evaluationCsv(evaluation), /^object,tracked,error/);
  const lines = tracklens.evaluationText(evaluation).trimEnd().split("\n");
  assert.equal(lines.length, 3);
  assert.match(lines[0], /^Tracking capability .* of 3 objects tracked; cube e = .* \(threshold 0\.015\)/);
  assert.match(tracklens.evaluationTex(evaluation), /^\\begin\{table\}[^]*\\toprule[^]*cube/);
  const matrix = tracklens.matrixFigure(evaluation, Int32Array.of(1, -1, -1), undefined, 600);
  assert.match(matrix.svg, /^<svg/);
  assert.deepEqual([matrix.x, matrix.y], [[0, 4], [3, 0]]);
  assert.match(tracklens.capabilityFigure(evaluation, 2, undefined, 600).svg, /^<svg/);
  const errors = Float64Array.from(scoring.sequenceErrors(0, best), ({ error }) => error);
  assert.match(tracklens.sequencesFigure(errors, 0.015, 0, undefined, 600).svg, /^<svg/);
  assert.throws(() => tracklens.capabilityFigure(evaluation, 2, { foreground: "red" }, 600), /#rrggbb/);

  assert.equal(
    scoring.command({ truth: "my truth.csv", checkpoint: "w.pth", frames: "frames" }, { ...options, thresholds: { cube: 0.02 } }),
    "tracklens eval --checkpoint w.pth --frames frames --truth 'my truth.csv' --threshold 'cube=0.02' --folds 3 " +
      "--bootstrap 30 --resampling-seed 7 --sequences --context",
  );
});

/** The files of a training as `tracklens train` writes them; the error of its cube falls to `error`. */
function training(architecture, seed, error, epochs = 4) {
  const config = {
    version: "0.1.0", git_hash: null, burn: "0.22.1", target: "x86_64-linux", threads: 1,
    sae: {
      architecture, keypoints: 16, encoder_channels: [32, 64, 128], encoder_kernels: [3, 3, 3], decoder_channels: [64, 32, 16],
      decoder_kernels: [3, 3, 3], input_size: null, target_size: [64, 64], temperature: 1, trained_temperature: false, sigma: 0.1,
      sigma_per_keypoint: false, sigma_limit: null,
    },
    epochs, seed, batch: 8, learning_rate: 0.001, noise: 0.001, split: { training: 0.5, validation: 0.25 }, velocity_weight: 0,
    drop_last: true, validation_frames: "first", target_filter: "bilinear", input_size: [64, 64], objects: ["cube"],
    training_sequences: ["a", "b"], validation_sequences: ["c"],
  };
  const log = Array.from({ length: epochs }, (_, i) => {
    const losses = { total: 0.02, reconstruction: 0.02 / (i + 1), velocity: 0 };
    const errors = { cube: error * (epochs - i) };
    const maps = { affine: errors, identity: errors, "scale-translate": errors };
    return JSON.stringify({ epoch: i + 1, seconds: 1, training: losses, validation: losses, tc: 0.5, errors: maps });
  });
  const summary = { version: "0.1.0", interrupted: false, epochs, best_epoch: epochs, seconds: 9, last: null, evaluation: null };
  const utf8 = (text) => new TextEncoder().encode(text);
  return { config: utf8(JSON.stringify(config)), log: utf8(`${log.join("\n")}\n`), summary: utf8(JSON.stringify(summary)) };
}

test("runs are compared by groups, and what does not count is told", () => {
  const comparison = new tracklens.Comparison();
  assert.deepEqual([comparison.dataSets, comparison.unread], [[], []]);
  assert.throws(() => comparison.compare(), /run/);
  // Three of four runs of the one track the cube, none of the other.
  const runs = { basic: [0.001, 0.002, 0.003, 0.04], dsae: [0.05, 0.06, 0.07, 0.08] };
  for (const [architecture, errors] of Object.entries(runs)) {
    for (const [seed, error] of errors.entries()) {
      comparison.addRun(`${architecture}/${seed}`, training(architecture, seed, error));
    }
  }
  const { config, log, summary } = training("basic", 9, 0.01);
  comparison.addRun("cut", { config, log: log.subarray(0, log.length - 9), summary });
  comparison.addRun("failed", { config: null, error: new TextEncoder().encode("no space left on the disk\n") });
  assert.throws(() => comparison.addRun("text", { config: "{}" }), /`config` of text is not a Uint8Array/);
  const [set, ...more] = comparison.dataSets;
  assert.deepEqual([more, set.objects, set.trained, set.settings, set.runs.length], [[], ["cube"], true, [], 9]);
  assert.match(set.runs.find(({ name }) => name === "cut").incomplete, /its log breaks off/);
  assert.deepEqual(comparison.unread, [{ name: "failed", reason: "it failed: no space left on the disk" }]);

  const compared = comparison.compare();
  const { report, figures } = compared;
  assert.equal(report.schema, "tracklens/report/1");
  assert.deepEqual(report.groups.map(({ name, complete, tc }) => [name, complete, tc]), [["basic", 4, 0.75], ["dsae", 4, 0]]);
  const [basic] = report.groups;
  assert.equal(basic.incomplete[0].name, "cut");
  assert.ok(Math.abs(basic.objects[0].mean - 0.0115) < 1e-12 && basic.objects[0].threshold === 0.015);
  const [low, high] = basic.tc_interval;
  assert.ok(low < 0.75 && high <= 1);
  const better = report.improvement.find(({ group, over }) => group === "basic" && over === "dsae");
  assert.equal(better.probability, 1);
  assert.deepEqual(comparison.compare().report, report);
  assert.match(comparison.compare({ seed: 7, resamples: 200 }).report.intervals, /200 resamples, seed 7/);
  assert.equal(comparison.compare({ thresholds: { cube: 0.0015 } }).report.groups[0].tc, 0.25);
  assert.deepEqual(compared.tables.map(({ name }) => name), ["capability", "errors", "improvement", "runs"]);
  const [, errors] = compared.tables;
  const mean = errors.columns.findIndex(({ label }) => label === "mean");
  assert.equal(errors.rows[0][mean].value, basic.objects[0].mean);
  assert.equal(errors.rows[0][mean].text, basic.objects[0].mean.toFixed(4));
  assert.ok(compared.tables.every(({ columns, rows }) => rows.every((cells) => cells.length === columns.length)));
  assert.ok(["boxplots", "errors-basic", "reconstruction-loss"].every((name) => figures.some((figure) => figure.name === name)));
  assert.ok(figures.every(({ svg, caption }) => svg.startsWith("<svg") && caption.length > 0));
  assert.match(compared.toHtml(), /^<!DOCTYPE html>[^]*no space left on the disk/);
  assert.match(compared.toMarkdown(), /\| basic \|/);
  assert.equal(compared.runsCsv().trim().split("\n").length, 1 + 8 + 2);
  assert.equal(compared.errorsCsv().trim().split("\n").length, 1 + 2);

  comparison.addRun("long", training("basic", 5, 0.001, 6));
  assert.deepEqual(comparison.dataSets[0].settings, ["epochs"]);
  const names = (groupBy) => comparison.compare({ groupBy }).report.groups.map(({ name }) => name);
  assert.deepEqual(names("epochs"), ["epochs 4", "epochs 6"]);
  assert.deepEqual(names("architecture"), ["basic", "dsae"]);
  assert.throws(() => names("weather"), /weather/);
  assert.throws(() => comparison.compare({ dataSet: 1 }), /there is no data set 1/);
  assert.throws(() => comparison.compare({ groups: "name" }), /unknown field `groups`; expected dataSet/);
});

test("run folders are found among other files", () => {
  const paths = ["a/config.json", "a/log.jsonl", "a/x.png", "b.partial/error.txt", "c/config.json"];
  paths.push("a/checkpoint_best.safetensors");
  assert.deepEqual(tracklens.findRuns(paths), {
    runs: [
      { folder: "a", config: 0, log: 1, summary: null, error: null, best: 5, last: null },
      { folder: "b.partial", config: null, log: null, summary: null, error: 3, best: null, last: null },
    ],
    rest: [2, 4],
  });
});

test("detectors that were scored are runs of their own data set", async () => {
  const { table } = await extractAll();
  const truth = tracklens.GroundTruthTable.parse(await read("ground_truth.csv"), "ground_truth.csv");
  const evaluation = new tracklens.Scoring(truth, table).evaluate();
  const comparison = new tracklens.Comparison();
  comparison.addRun("basic/0", training("basic", 0, 0.001));
  comparison.addEvaluation("mine_seed0.csv", evaluation);
  comparison.addEvaluation("weights.pth", evaluation, "keynet");
  assert.throws(() => comparison.addEvaluation("other.csv", { tc: 1 }), /the evaluation of other\.csv/);
  const sets = comparison.dataSets;
  assert.deepEqual(sets.map(({ trained, runs }) => [trained, runs.map(({ architecture }) => architecture)]), [
    [true, ["basic"]],
    [false, ["mine", "keynet"]],
  ]);
  assert.match(sets[1].reason, /cube/);
  const { report } = comparison.compare({ dataSet: 1 });
  const errors = evaluation.objects.map(({ error }) => error);
  assert.deepEqual(report.groups.map(({ runs }) => runs[0].errors), [errors, errors]);

  // Under another map errors are not the same thing.
  const apart = new tracklens.Comparison();
  apart.addEvaluation("a.json", evaluation);
  apart.addEvaluation("b.json", { ...evaluation, transform: "identity" });
  assert.match(apart.dataSets[1].reason, /a\.json and b\.json: one is scored under the map `affine`, the other under `identity`/);
});

test("what the numbers of a table are taken for is told with its ground", () => {
  const bytes = new TextEncoder().encode("frame,cube_x,cube_y\n1,0,0\n");
  const { reading } = tracklens.GroundTruthTable.parse(bytes, "t.csv", { indexBase: 1 });
  assert.deepEqual(reading, {
    layout: "one row a frame",
    space: { value: "ndc", by: "guess" },
    axisOrder: { value: "xy", by: "file" },
    indexBase: { value: 1, by: "said" },
    flip: { value: "none", by: "guess" },
    firstKeypoint: 1,
    zeroIsMissing: { value: false, by: "guess" },
  });
});

test("what looks wrong with the data is found, with what puts it right", () => {
  const rows = (header, point) => {
    const lines = [header];
    for (let sequence = 0; sequence < 12; sequence += 1) {
      for (let frame = 0; frame < 20; frame += 1) {
        const i = frame + 37 * sequence;
        lines.push(`${sequence},${point(frame, [0.85 * Math.sin(0.37 * i), 0.85 * Math.cos(0.71 * i)])}`);
      }
    }
    return new TextEncoder().encode(lines.join("\n"));
  };
  const truthOf = (first) =>
    tracklens.GroundTruthTable.parse(
      rows("sequence,frame,object,x,y", (frame, [x, y]) => `${frame + first},cube,${x},${y}`),
      "gt.csv",
    );
  const keypoints = tracklens.KeypointTable.parse(
    rows("sequence,frame,keypoint,x,y", (frame, [x, y]) => `${frame},0,${0.9 * x + 0.01 * Math.sin(90 * x)},${0.9 * y}`),
    "kp.csv",
  );
  const found = (truth, alignment) => tracklens.examine(truth.toObject(), keypoints.toObject(), {}, alignment);
  assert.deepEqual(found(truthOf(0)), []);
  const [finding] = found(truthOf(1));
  assert.equal(finding.problem, "counting");
  assert.deepEqual(finding.remedies, [{ type: "count-from", side: "truth", first: 1 }]);
  assert.deepEqual(found(truthOf(1), { frames: -1 }), []);
  assert.throws(() => found(truthOf(0), { frame: 1 }), /the alignment: unknown field `frame`/);
  assert.throws(() => tracklens.examine({}, keypoints.toObject()), /the table: /);

  const apart = () => new tracklens.Scoring(truthOf(1000), keypoints);
  assert.throws(apart, (error) => {
    assert.deepEqual(error.reason, { type: "otherNumbers", frames: -1000, sequences: 0 });
    return true;
  });

  // The same tables over time: keypoint 0 is where the object is, in the same frame.
  const measure = (truth, options) => tracklens.temporalQuality(truth.toObject(), keypoints.toObject(), {}, {}, options);
  const { folds, measures } = measure(truthOf(0));
  assert.equal(folds, 5);
  const of = (name) => measures.find(({ measure }) => measure === name).objects[0];
  assert.equal(of("lag"), 0);
  assert.ok(of("velocity_correlation") > 0.99);
  assert.ok(of("held_out_affine") < 1e-3);
  assert.equal(measure(truthOf(0), { folds: 0 }).folds, 0);
  assert.throws(() => measure(truthOf(0), { transfrom: "affine" }), /the options of temporalQuality: unknown field/);
  assert.throws(() => tracklens.temporalQuality({}, {}), /the table: /);
  const evaluation = new tracklens.Scoring(truthOf(0), keypoints).evaluate();
  assert.equal(tracklens.temporalTable(evaluation), null);
  assert.equal(tracklens.temporalTable({ ...evaluation, temporal: { folds, measures } }).rows.length, measures.length);
});

test("all that a join leaves over is listed by sequence", async () => {
  const frames = new tracklens.FrameIndex((await paths()).filter((path) => !path.startsWith("seq_0001")));
  const text = "sequence,frame,object,x,y\n" + [0, 1, 2, 9].map((t) => `seq_0000,${t},cube,0,0\n`).join("");
  const truth = tracklens.GroundTruthTable.parse(new TextEncoder().encode(text), "gt.csv");
  const { unmatched } = tracklens.joinFrames(frames, truth);
  assert.deepEqual(unmatched.rows, [{ sequence: "seq_0000", count: 1, frames: "9" }]);
  assert.deepEqual(
    unmatched.frames.map(({ sequence, count, frames: numbers }) => [sequence, count, numbers]),
    [
      ["seq_0000", 2, "3–4"],
      ["seq_0012", 5, "0–4"],
    ],
  );
});

test("a recording is read from its parts: frames where they lie, points as a ground truth or keypoints", async () => {
  const file = await readFile(new URL("../data/formats/frames.npz", import.meta.url));
  const { entries, needs } = tracklens.readArchive(file, file.length, "frames.npz");
  assert.equal(needs, null);
  const arrays = new tracklens.Arrays("frames.npz");
  const npy = {};
  for (const { path, offset, size, deflated } of entries) {
    assert.equal(deflated, false);
    const start = offset + 30 + file.readUInt16LE(offset + 26) + file.readUInt16LE(offset + 28);
    const name = path.replace(".npy", "");
    npy[name] = file.subarray(start, start + size);
    if (tracklens.Arrays.uses(name)) arrays.add(name, npy[name].subarray(0, tracklens.Arrays.bytesNeeded(name, size)), size);
  }
  const { array, paths, width, height, start, length, header } = arrays.frames();
  assert.deepEqual([paths.length, width, height, length], [15, 16, 16, 16 * 16 * 3]);
  assert.equal(paths[6], "seq_0001/frame_000001");
  const index = tracklens.FrameIndex.ofAll(paths);
  assert.deepEqual(index.sequences[1], { name: "seq_0001", start: 5, length: 5 });
  const truth = arrays.groundTruth();
  assert.equal(tracklens.joinFrames(index, truth).matched, 15);
  assert.deepEqual(truth.reading.axisOrder, { value: "xy", by: "guess" });
  assert.equal(arrays.keypoints({ axisOrder: "yx" }).keypoints, 5);
  // A frame with the header before it is an image for the encoder.
  const frame = Buffer.concat([Buffer.from(header), npy[array].subarray(start + 6 * length, start + 7 * length)]);
  const encoder = new tracklens.Encoder(await golden("basic-vel-std-bg-tiny.safetensors"), "w");
  assert.deepEqual([encoder.extract(frame, paths[6]).width, encoder.extract(frame, paths[6]).height], [16, 16]);
  assert.throws(() => tracklens.readArchive(file.subarray(0, 900), 900, "cut.npz"), /cut\.npz: not a whole ZIP archive/);
});

test("frames of episodes of unequal length are those of their episodes", () => {
  const array = (descr, shape, bytes) => {
    const text = `{'descr': '${descr}', 'fortran_order': False, 'shape': (${shape}), }`;
    const padded = text.padEnd(Math.ceil((text.length + 11) / 64) * 64 - 11) + "\n";
    const head = [0x93, ..."NUMPY"].map((c) => (typeof c === "string" ? c.charCodeAt(0) : c));
    const length = [padded.length & 255, padded.length >> 8];
    return Buffer.concat([Buffer.from([...head, 1, 0, ...length]), Buffer.from(padded), Buffer.from(bytes)]);
  };
  const arrays = new tracklens.Arrays("replay.npz");
  const frames = array("|u1", "5, 16, 16, 3", new Uint8Array(5 * 16 * 16 * 3));
  const ends = array("<i8", "2,", new Uint8Array(new BigInt64Array([2n, 5n]).buffer));
  for (const [name, bytes] of Object.entries({ frames, episode_ends: ends })) {
    assert.ok(tracklens.Arrays.uses(name), name);
    arrays.add(name, bytes.subarray(0, tracklens.Arrays.bytesNeeded(name, bytes.length)), bytes.length);
  }
  const index = tracklens.FrameIndex.ofAll(arrays.frames().paths);
  assert.deepEqual(index.sequences.map(({ length }) => length), [2, 3]);
});

test("frames of an HDF5 file are read by slices", async () => {
  const name = "recording.hdf5";
  const file = await readFile(new URL("../data/formats/options.hdf5", import.meta.url));
  const asked = [];
  const read = (start, length) => {
    asked.push(length);
    return new Uint8Array(file.subarray(start, start + length));
  };
  const opened = tracklens.Hdf5File.open(read, file.length, name);
  assert.equal(opened.problem, "");
  assert.equal(opened.paths.length, 15);
  assert.equal(opened.paths[6], "seq_0001/frame_000001");
  const encoder = new tracklens.Encoder(await golden("basic-vel-std-bg-tiny.safetensors"), "w");
  const frame = opened.frame(6);
  assert.deepEqual([encoder.extract(frame, "f").width, encoder.extract(frame, "f").height], [16, 16]);
  assert.ok(asked.length > 0);
  assert.throws(() => opened.frame(15), /there is no frame 15/);
  opened.free();
  const cut = tracklens.Hdf5File.open(() => new Uint8Array(), file.length, name);
  assert.ok(cut.problem.startsWith(`${name}: `) && cut.problem.includes("cannot be read"));
  assert.throws(() => cut.points(), /recording\.hdf5/);
});

test("a Zarr hierarchy is read from the files of its folder and from an archive", async () => {
  const name = "replay.zarr";
  const archive = await readFile(new URL("../public/files/replay.zarr.zip", import.meta.url));
  const read = (start, length) => new Uint8Array(archive.subarray(start, start + length));
  const whole = tracklens.ZarrFile.openArchive(read, archive.length, name);
  const { entries } = tracklens.readArchive(new Uint8Array(archive), archive.length, name);
  // Those of Zarr are stored as they are, behind a header of 30 bytes, its name and no more.
  const files = entries.map(({ path, offset, packed }) => {
    const start = offset + 30 + Buffer.byteLength(path);
    return { path: path.slice(name.length + 1), bytes: archive.subarray(start, start + packed) };
  });
  const asked = [];
  const ofFolder = tracklens.ZarrFile.open(
    (i) => {
      asked.push(files[i].path);
      return new Uint8Array(files[i].bytes);
    },
    files.map(({ path }) => path),
    Float64Array.from(files, ({ bytes }) => bytes.length),
    name,
  );
  for (const opened of [whole, ofFolder]) {
    assert.equal(opened.problem, "");
    assert.deepEqual(opened.cameras, []);
    assert.match(opened.paths[0], /^episode_0\/frame_/);
    const points = opened.points();
    assert.deepEqual(points.arrays.map(({ name }) => name).sort(), ["episode_ends", "keypoint"]);
    assert.ok(opened.candidates().some(({ name }) => name === "state"));
  }
  assert.deepEqual(ofFolder.frame(3), whole.frame(3));
  assert.ok(asked.some((path) => path.startsWith("data/img/")));
  const table = new TextDecoder().decode(ofFolder.named("nose=state[0:2]").table);
  assert.match(table, /^sequence,frame,object,x,y\nepisode_0,0,nose,/);
  assert.throws(() => ofFolder.named("nose=nothing"), /there is no array `nothing`/);
  const gone = tracklens.ZarrFile.open(() => undefined, ["a/.zarray"], Float64Array.of(9), name);
  assert.match(gone.problem, /^replay\.zarr: .*`a\/.zarray`: it cannot be read/);
  assert.throws(() => tracklens.ZarrFile.openArchive(() => new Uint8Array(), 99, name), /replay\.zarr/);
  for (const opened of [whole, ofFolder, gone]) opened.free();
});

test("latent points are placed in an image by the configuration of their encoder", async () => {
  const { encoder } = await extractAll();
  // Three pools make 33 cells of 256 pixels, from pixel -3.5 to 252.5.
  const [first, last] = [-3.5, 252.5].map((pixel) => (2 * pixel + 1) / 256 - 1);
  const placed = tracklens.latentToImage(encoder.info.config, new Float64Array([-1, 1, 0, -1]), 256, 256);
  const expected = [first, last, (first + last) / 2, first];
  assert.ok(placed.every((v, i) => Math.abs(v - expected[i]) < 1e-12), `${placed}`);
  assert.throws(() => tracklens.latentToImage("{}", new Float64Array(), 256, 256), /configuration of the encoder/);
});

test("a worker loads one part alone, from a module that was compiled elsewhere", async () => {
  const script = `
    import { parentPort, workerData } from "node:worker_threads";
    const { default: init, Encoder, FrameIndex, extractionMemory } = await import(workerData.package);
    const { name, module, weights, frame } = workerData;
    await init({ extraction: module });
    const { points } = new Encoder(weights, name).extract(frame, name);
    let scoring = true;
    try { new FrameIndex(["a/0.png"]); } catch { scoring = false; }
    parentPort.postMessage({ points, scoring, memory: extractionMemory() });
  `;
  const workerData = {
    package: new URL("../../pkg/node.js", import.meta.url).href,
    name: "w.safetensors",
    module: await tracklens.compile("extraction"),
    weights: await golden("basic-vel-std-bg-tiny.safetensors"),
    frame: await read("seq_0000/frame_000.png"),
  };
  const url = new URL(`data:text/javascript,${encodeURIComponent(script)}`);
  const worker = new Worker(url, { workerData });
  const found = await new Promise((resolve, reject) => worker.once("message", resolve).once("error", reject));
  await worker.terminate();
  const here = new tracklens.Encoder(workerData.weights, "w").extract(workerData.frame, "f");
  assert.deepEqual(found.points, here.points);
  assert.equal(found.scoring, false);
  assert.ok(found.memory > 2 ** 20);
  await assert.rejects(init(["scorign"]), /no part "scorign"; expected scoring, space, doctor, extraction, images, formats, parquet, zarr, onnx, temporal, figures, comparison/);
});

test("foreign ONNX models find what ONNX Runtime finds", async () => {
  const models = new URL("../data/onnx/", import.meta.url);
  const expected = JSON.parse(await readFile(new URL("expected.json", models), "utf8"));
  for (const [name, { settings, frames }] of Object.entries(expected)) {
    const bytes = await readFile(new URL(`${name}.onnx`, models));
    const detector = new tracklens.Detector(bytes, name, JSON.stringify(settings));
    assert.equal(detector.info.config, null);
    for (const [path, { points, confidences }] of Object.entries(frames)) {
      const found = detector.extract(await read(path), path);
      assert.deepEqual([found.width, found.height], [256, 256]);
      assert.equal(detector.info.keypoints, points.length);
      // Two runtimes add the same products in another order; 1e-4 is 1/80 of a pixel.
      const near = (a, b) => assert.ok(Math.abs(a - b) < 1e-4 * Math.max(1, Math.abs(b)), `${name} ${path}: ${a}, ${b}`);
      points.flat().forEach((value, i) => near(found.points[i], value));
      confidences.forEach((value, i) => near(found.confidences[i], value));
      found.free();
    }
    detector.free();
  }
  assert.ok(tracklens.detectorMemory() > 2 ** 20);
});

test("a model says what it leaves open, as data", async () => {
  const bytes = await readFile(new URL("../data/onnx/points.onnx", import.meta.url));
  const reasonOf = (settings) => {
    try {
      new tracklens.Detector(bytes, "points.onnx", settings);
    } catch (error) {
      return error.reason;
    }
    return null;
  };
  assert.deepEqual(reasonOf(""), { type: "detectorSettings", missing: ["normalization", "columns", "unit"] });
  assert.deepEqual(reasonOf('{"normalize": "bytes", "unit": "px"}'), { type: "detectorSettings", missing: ["columns"] });
  assert.throws(() => new tracklens.Detector(bytes, "points.onnx", '{"normalise": "bytes"}'), /points.onnx: these are no settings.*normalise/);
  assert.throws(() => new tracklens.Detector(bytes, "points.onnx", '{"normalize": "bytes", "mean": [0]}'), /expected one of both ways/);
});

test("what a browser downloads stays small", async () => {
  const pkg = new URL("../../pkg/", import.meta.url);
  const sent = async (file) => gzipSync(await readFile(new URL(file, pkg)), { level: 9 }).length;
  // What has to be there before the page can be used, what a score waits for, what workers load,
  // what comes with the first points in space, JPEG or WebP image, HDF5 file or pickle, Parquet file,
  // Zarr hierarchy, ONNX model, score, and runs.
  for (const [part, limit] of Object.entries({ scoring: 320_000, space: 356_000, doctor: 100_000, extraction: 300_000, images: 250_000, formats: 330_000, parquet: 250_000, zarr: 820_000, onnx: 700_000, temporal: 150_000, figures: 200_000, comparison: 340_000 })) {
    const size = (await sent(`tracklens_${part}_bg.wasm`)) + (await sent(`tracklens_${part}.js`));
    assert.ok(size <= limit, `${part} is ${size} bytes gzipped; expected at most ${limit}`);
  }
});
