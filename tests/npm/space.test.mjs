// Points in space by the package: the part `space` in the place of `scoring`, cameras, commands.
import assert from "node:assert/strict";
import { before, test } from "node:test";

import init, * as tracklens from "../../pkg/node.js";

const FRAMES = 90;
const bytes = (text) => new TextEncoder().encode(text);

/** Positions of two objects in metres. */
const at = (t) => [
  [0.5 * Math.sin(0.9 * t), 0.4 * Math.cos(1.7 * t), 0.3 * Math.sin(0.7 * t)],
  [0.3 * Math.cos(1.1 * t), 0.2 * Math.sin(0.6 * t), 0.4 * Math.cos(1.9 * t)],
];
const rows = (of) =>
  Array.from({ length: FRAMES }, (_, t) =>
    at(t).map((point, n) => [`seq_${Math.floor(t / 30)}`, t % 30, n, ...of(point)].join(",")),
  ).flat();
const table = (column, axes, of) => bytes([`sequence,frame,${column},${axes}`, ...rows(of)].join("\n"));

const truth = table("object", "x,y,z", (point) => point);
const inSpace = table("keypoint", "x,y,z", ([x, y, z]) => [2 * y + 1, x - z, z + 0.5 * x]);
const inImage = table("keypoint", "x,y", ([x, y, z]) => [
  ((0.9 * 90 * x) / (z + 2) + 50) / 50 - 1,
  (90 * y / (z + 2) + 40) / 40 - 1,
]);
const camera = {
  image_size: [100, 80],
  intrinsics: [[90, 0, 49.5], [0, 90, 39.5], [0, 0, 1]],
  rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
  translation: [0, 0, 2],
};

before(() => init(["scoring"]));

test("without the part `space` three coordinates are refused, with a reason", () => {
  const parse = () => tracklens.GroundTruthTable.parse(truth, "truth.csv");
  assert.throws(parse, ({ kind, reason }) => kind === "input" && reason.type === "inSpace");
  const flat = tracklens.GroundTruthTable.parse(truth, "truth.csv", { xyOnly: true });
  assert.equal(flat.axes, 2);
});

test("with it they are scored in space", async () => {
  const before = tracklens.KeypointTable.parse(inImage, "kp.csv");
  await init(["space"]);
  const { GroundTruthTable, KeypointTable, Scoring } = tracklens;
  const table = GroundTruthTable.parse(truth, "truth.csv");
  assert.equal(table.axes, 3);
  // What was made before means nothing to it, which is an error and not a number.
  assert.throws(() => new Scoring(table, before));
  before.free();

  const scoring = new Scoring(table, KeypointTable.parse(inSpace, "kp.csv"));
  assert.deepEqual([...scoring.axes], [3, 3]);
  const evaluation = scoring.evaluate();
  assert.equal(evaluation.schema, "tracklens/evaluation/4");
  assert.deepEqual(evaluation.dimensions, { keypoints: 3, truth: 3 });
  assert.equal(evaluation.rank, "centred");
  assert.equal(evaluation.tc, 1);
  for (const [k, { error, best_keypoint: best, map }] of evaluation.objects.entries()) {
    assert.equal(best, k);
    // The map is known: what is left is rounding.
    assert.ok(error < 1e-12, String(error));
    assert.deepEqual([map.a.length, map.a[0].length, map.b.length], [3, 3, 3]);
  }
  assert.equal(scoring.series(0, 0).truth.length, 3 * FRAMES);
  assert.equal(scoring.keypointsAt(0).length, 2 * 3);
  const inputs = { truth: "truth.csv", keypoints: "kp.csv" };
  assert.equal(scoring.command(inputs), "tracklens score --truth truth.csv --keypoints kp.csv");
  assert.match(scoring.command(inputs, { rank: "reference" }), /--rank reference$/);
});

test("a camera puts a ground truth into its image", () => {
  const { Camera, GroundTruthTable, KeypointTable, Scoring } = tracklens;
  const seen = Camera.parse(bytes(JSON.stringify(camera)), "camera.json");
  assert.deepEqual([...seen.imageSize], [100, 80]);
  const table = GroundTruthTable.parse(truth, "truth.csv").projected(seen);
  assert.equal(table.axes, 2);
  const scoring = new Scoring(table, KeypointTable.parse(inImage, "kp.csv"));
  const evaluation = scoring.evaluate();
  assert.deepEqual(evaluation.camera, { projected: 2 * FRAMES, behind: 0 });
  for (const { error } of evaluation.objects) assert.ok(error < 1e-12, String(error));
  const command = scoring.command({ truth: "truth.csv", keypoints: "kp.csv", camera: "camera.json" });
  assert.match(command, /--camera camera\.json/);

  assert.throws(() => table.projected(seen), /camera\.json: the ground truth has two coordinates/);
  const broken = { ...camera, intrinsics: [[0, 0, 0], [0, 1, 0], [0, 0, 1]] };
  assert.throws(
    () => Camera.parse(bytes(JSON.stringify(broken)), "camera.json"),
    ({ message }) => message.startsWith("camera.json: `intrinsics`"),
  );
});
