// Files as people have them (tests/public) by the package, as the page reads them: what they hold
// comes to the errors that numpy computed beside, and what cannot be read is refused in words.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { before, test } from "node:test";

import init, * as tracklens from "../../pkg/node.js";

const folder = new URL("../public/", import.meta.url);
const read = async (path) => new Uint8Array(await readFile(new URL(`files/${path}`, folder)));
const { cases, truth, keypoints } = JSON.parse(await readFile(new URL("expected.json", folder), "utf8"));

before(() => init(["scoring", "formats", "parquet", "zarr"]));

/** The options of a case as the package takes them. */
function given({ space, axis_order: axisOrder, index_base: indexBase, image_size: imageSize }) {
  const all = Object.entries({ space, axisOrder, indexBase, imageSize });
  return Object.fromEntries(all.filter(([, value]) => value !== undefined));
}

/**
 * What a file of another program holds: HDF5 and Zarr by slices, pickles, and Parquet by a part of
 * its own. `columns` name arrays of a recording.
 */
function foreign(bytes, file, columns) {
  const { Hdf5File, ZarrFile, needsFormats, needsParquet, readParquet, readPoints } = tracklens;
  const isZarr = file.endsWith(".zarr.zip");
  if (needsParquet(bytes)) return readParquet(bytes, file);
  if (!isZarr && !needsFormats(bytes)) return null;
  if (!isZarr && bytes[0] !== 0x89) return readPoints(bytes, file);
  const read = (start, length) => bytes.slice(start, start + length);
  const open = isZarr ? ZarrFile.openArchive : Hdf5File.open;
  const opened = open(read, bytes.length, file);
  try {
    const isTable = columns && opened.candidates().length === 0;
    return columns && !isTable ? { ...opened.named(columns), isNamed: true } : opened.points();
  } finally {
    opened.free();
  }
}

/** Points of a file, opened as the page opens it, and what is told of them. */
function open(bytes, file, isTruth, options, columns) {
  const { Arrays, GroundTruthTable, KeypointTable, mapColumns } = tracklens;
  const ofArrays = (arrays) => (isTruth ? arrays.groundTruth(options) : arrays.keypoints(options));
  const arrays = new Arrays(file);
  if (file.endsWith(".npy")) {
    arrays.add("keypoints", bytes, bytes.length);
    return { table: ofArrays(arrays), told: [] };
  }
  const found = foreign(bytes, file, columns);
  if (found?.arrays) {
    for (const { name, bytes } of found.arrays) arrays.add(name, bytes, bytes.length);
    return { table: ofArrays(arrays), told: [] };
  }
  let text = found?.table ?? bytes;
  if (columns && !found?.isNamed) {
    const names = columns.split(",").map((pair) => pair.split("="));
    const [expected, given] = [0, 1].map((i) => names.map((pair) => pair[i]));
    text = mapColumns(text, file, expected, given, !isTruth);
  }
  const own = found?.space ? { space: found.space } : {};
  const parse = isTruth ? GroundTruthTable.parse : KeypointTable.parse;
  return { table: parse(text, file, { ...own, ...options }), told: found?.notices ?? [] };
}

/**
 * A test of a case by the part that scores.
 * @param {string} part
 */
function check({ file, role, options, errors, objects, notes, axes, ...each }, part) {
  const refused = each.refused ?? each.refused_by_page;
  test(`${file} is ${refused === undefined ? "read" : "refused"} by ${part}`, async () => {
    const { GroundTruthTable, KeypointTable, Scoring } = tracklens;
    const bytes = await read(file);
    const isTruth = role === "truth";
    if (refused !== undefined) {
      const opened = () => open(bytes, file, isTruth, given(options), options.columns);
      assert.throws(opened, ({ message }) => message.includes(refused));
      return;
    }
    if (axes === 3 && part === "scoring") {
      const opened = () => open(bytes, file, isTruth, given(options), options.columns);
      assert.throws(opened, ({ reason }) => reason.type === "inSpace");
      return;
    }
    const { table, told } = open(bytes, file, isTruth, given(options), options.columns);
    const texts = [...told, ...table.notices];
    for (const note of notes) assert.ok(texts.some((text) => text.includes(note)), note);
    if (isTruth) assert.deepEqual(table.objects, objects);
    const beside = each.beside ?? (isTruth ? keypoints : truth);
    const other = (isTruth ? KeypointTable : GroundTruthTable).parse(await read(beside), beside);
    const scoring = isTruth ? new Scoring(table, other) : new Scoring(other, table);
    const found = scoring.evaluate({ folds: 0 }).errors.flat();
    const theirs = errors.flat();
    assert.equal(found.length, theirs.length);
    // Both solve least squares in f64, by other algorithms; coordinates are near 1, but for those in
    // space, whose errors are as large as their unit is small.
    for (const [i, error] of theirs.entries()) {
      if (error === null) assert.equal(found[i], null);
      else assert.ok(Math.abs(found[i] - error) <= 1e-12 * Math.max(error, 1), `${found[i]} and ${error}`);
    }
  });
}

// Archives are opened by the page before the package sees what is in them.
const opened = cases.filter((each) => !each.file.endsWith(".npz") && !each.terminal_only);
for (const each of opened) check(each, "scoring");
test("the part `space` takes the place of `scoring`", () => init(["space"]));
for (const each of opened) check(each, "space");
