// Files as people have them (tests/public) by the package, as the page reads them: what they hold
// comes to the errors that numpy computed beside, and what cannot be read is refused in words.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { before, test } from "node:test";

import init, * as tracklens from "../../pkg/node.js";

const folder = new URL("../public/", import.meta.url);
const read = async (path) => new Uint8Array(await readFile(new URL(`files/${path}`, folder)));
const { cases, truth, keypoints } = JSON.parse(await readFile(new URL("expected.json", folder), "utf8"));

before(() => init(["scoring"]));

function parse(table, bytes, file, { space, axis_order: axisOrder, index_base: indexBase, image_size: imageSize }) {
  const given = Object.entries({ space, axisOrder, indexBase, imageSize }).filter(([, value]) => value !== undefined);
  return table.parse(bytes, file, Object.fromEntries(given));
}

for (const { file, role, options, refused, errors, objects, notes } of cases) {
  // Containers are opened by the page before the package sees what is in them.
  if (/\.(npz|npy|h5)$/.test(file)) continue;
  test(`${file} is ${refused === undefined ? "read" : "refused"}`, async () => {
    const { GroundTruthTable, KeypointTable, Scoring } = tracklens;
    const bytes = await read(file);
    const isTruth = role === "truth";
    const open = () => parse(isTruth ? GroundTruthTable : KeypointTable, bytes, file, options);
    if (refused !== undefined) {
      assert.throws(open, ({ message }) => message.includes(refused));
      return;
    }
    const table = open();
    for (const note of notes) assert.ok(table.notices.some((text) => text.includes(note)), note);
    if (isTruth) assert.deepEqual(table.objects, objects);
    const other = isTruth
      ? KeypointTable.parse(await read(keypoints), keypoints)
      : GroundTruthTable.parse(await read(truth), truth);
    const scoring = isTruth ? new Scoring(table, other) : new Scoring(other, table);
    const found = scoring.evaluate({ folds: 0 }).errors.flat();
    const theirs = errors.flat();
    assert.equal(found.length, theirs.length);
    // Both solve least squares in f64, by other algorithms; coordinates are near 1.
    for (const [i, error] of theirs.entries()) {
      if (error === null) assert.equal(found[i], null);
      else assert.ok(Math.abs(found[i] - error) <= 1e-12, `${found[i]} and ${error}`);
    }
  });
}
