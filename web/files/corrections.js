// @ts-check
/** What a file was taken for and how it was read, to be corrected. */

import { disclosure } from "../ui/disclosure.js";
import { h } from "../ui/dom.js";
import { baseName } from "../ui/format.js";
import { isTableRole, tableOf } from "./entry.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./entry.js").Entry} Entry
 * @typedef {import("./entry.js").Slot} Slot
 * @typedef {import("../pkg/index.js").TableOptions} TableOptions
 */

/** @type {Record<Slot | "unknown", { title: string, icon: string }>} */
export const ROLES = {
  "ground-truth": { title: "Ground truth", icon: "icon-table" },
  keypoints: { title: "Keypoints", icon: "icon-table" },
  checkpoint: { title: "Checkpoint", icon: "icon-checkpoint" },
  camera: { title: "Camera", icon: "icon-camera" },
  result: { title: "Saved evaluation", icon: "icon-file" },
  unknown: { title: "Not used", icon: "icon-file" },
};

/** @type {Record<NonNullable<TableOptions["space"]>, string>} */
const UNITS = { ndc: "ndc", px: "pixels", fraction: "0 to 1" };

/**
 * What of the reading of a table can be chosen: by the name of the option, with the value that holds
 * where neither the file nor the user says one.
 * @type {{ key: "space" | "xyOnly" | "axisOrder" | "flip" | "zeroIsMissing" | "indexBase",
 *   label: string, values: string[][], usual: string | number | boolean, parse: (value: string) => unknown }[]}
 */
const READINGS = [
  {
    key: "space",
    label: "Unit",
    values: [
      ["ndc", "ndc, −1 to +1"],
      ["px", "pixels"],
      ["fraction", "0 to 1"],
    ],
    usual: "ndc",
    parse: String,
  },
  {
    key: "xyOnly",
    label: "Points are",
    values: [
      ["false", "x, y and z"],
      ["true", "x and y, without z"],
    ],
    usual: false,
    parse: (value) => value === "true",
  },
  {
    key: "axisOrder",
    label: "Axes",
    values: [
      ["xy", "x, y"],
      ["yx", "y, x"],
    ],
    usual: "xy",
    parse: String,
  },
  {
    key: "flip",
    label: "Flipped",
    values: [
      ["none", "no axis"],
      ["x", "x"],
      ["y", "y"],
      ["xy", "both"],
    ],
    usual: "none",
    parse: String,
  },
  {
    key: "zeroIsMissing",
    label: "(0, 0) is",
    values: [
      ["false", "a position"],
      ["true", "a missing point"],
    ],
    usual: false,
    parse: (value) => value === "true",
  },
  {
    key: "indexBase",
    label: "First frame",
    values: [
      ["0", "0"],
      ["1", "1"],
    ],
    usual: 0,
    parse: Number,
  },
];

/** @type {Record<string, string>} */
const GROUNDS = { guess: "assumed", file: "from the file", said: "as you said" };

/**
 * @param {Session} session
 * @param {Entry} entry
 */
export function corrections(session, entry) {
  const table = tableOf(entry);
  const reading = table?.reading;
  const summary = reading
    ? [
        isInSpace(table) ? "in space" : UNITS[reading.space.value],
        `(${[...reading.axisOrder.value, ...(isInSpace(table) ? ["z"] : [])].join(", ")})`,
        `frames from ${reading.indexBase.value}`,
      ].join(" · ")
    : "Wrong type? Change it";
  const grounds = reading ? [reading.space, reading.axisOrder, reading.indexBase] : [];
  // The unit of positions in space is that of their file.
  if (isInSpace(table)) grounds.shift();
  const isGuess = grounds.some(({ by }) => by === "guess");
  const { role, by } = entry.taken;
  const choices = h(
    "div",
    { class: "corrections" },
    choice(
      "Role",
      "role",
      rolesOf(entry).map((each) => [each, ROLES[each].title]),
      { value: role, by },
      (next) => void session.setRole(entry, /** @type {Slot | "unknown"} */ (next)),
    ),
    ...(isTableRole(entry) ? readingChoices(session, entry) : []),
  );
  return disclosure(`corrections ${entry.path}`, [summary, isGuess && guessMark()], choices);
}

/**
 * How a table was read, each with the other ways to read it.
 * @param {Session} session
 * @param {Entry} entry a table
 */
function readingChoices(session, entry) {
  const table = tableOf(entry);
  const reading = table?.reading;
  const asked = READINGS.filter(({ key }) => {
    // Recordings count their frames from 0.
    if (key === "indexBase") return !entry.arrays;
    if (key === "space") return !isInSpace(table);
    return key !== "xyOnly" || isInSpace(table) || entry.options.xyOnly === true;
  });
  const read = asked.map(({ key, label, values, usual, parse }) =>
    choice(
      label,
      key,
      values,
      (key !== "xyOnly" && reading?.[key]) || givenOf(entry, key, usual),
      (value) => void session.setTableOptions(entry, { [key]: parse(value) }),
    ),
  );
  return [...read, ...shiftChoices(session, entry)];
}

/**
 * What the user says, where a reading does not say it.
 * @param {Entry} entry
 * @param {(typeof READINGS)[number]["key"]} key
 * @param {string | number | boolean} usual
 */
function givenOf({ options }, key, usual) {
  const value = options[key];
  return value === undefined ? { value: usual, by: "guess" } : { value, by: "said" };
}

/** @param {ReturnType<typeof tableOf>} [table] */
function isInSpace(table) {
  return table?.axes === 3;
}

/**
 * What is added to the numbers of frames and sequences, to be taken back.
 * @param {Session} session
 * @param {Entry} entry
 */
function shiftChoices(session, entry) {
  return Object.entries(entry.alignment).map(([what, by]) => {
    const label = what === "frames" ? "Frames shifted by" : "Sequences shifted by";
    const values = [String(by), "0"].map((value) => [value, value]);
    return choice(
      label,
      what,
      values,
      { value: by, by: "said" },
      (next) => void session.align(entry, { [what]: Number(next) }),
    );
  });
}

/**
 * Whether the size of the images is asked for at a file: its positions are in pixels, and no image
 * says it.
 * @param {Session} session
 * @param {Entry} entry
 */
export function takesSize({ frameSize, saidSize }, entry) {
  if (hasOwnBoard(entry)) return true;
  if (frameSize) return false;
  const { parsed } = entry;
  if (parsed.state === "broken") return parsed.cause?.type === "missingImageSize";
  return saidSize !== undefined && tableOf(entry)?.reading.space.value === "px";
}

/**
 * Whether positions lie on the board of a simulator, which need not have the size of the images.
 * @param {Entry} entry
 */
function hasOwnBoard({ parsed, options }) {
  const isAsked = parsed.state === "broken" && parsed.cause?.type === "unknownUnit";
  return isAsked || options.imageSize !== undefined;
}

/**
 * Sizes that are half entered: the list of files may be drawn anew in between.
 * @type {WeakMap<Entry, [string, string]>}
 */
const begun = new WeakMap();

/**
 * Width and height of images that are not here, or of a simulator's board.
 * @param {Session} session
 * @param {Entry} entry
 */
export function sizeField(session, entry) {
  const { path } = entry;
  const isBoard = hasOwnBoard(entry);
  const what = isBoard ? "Board" : "Image";
  const given = isBoard ? entry.options.imageSize : session.saidSize;
  const set = (/** @type {[number, number] | undefined} */ size) =>
    isBoard
      ? session.setTableOptions(entry, { space: size && "px", imageSize: size })
      : session.setImageSize(size);
  const hint = h("span", { class: "hint", role: "status" });
  const entered = begun.get(entry) ?? [0, 1].map((i) => String(given?.[i] ?? ""));
  const [width, height] = ["width", "height"].map((name, i) =>
    h("input", {
      type: "number",
      name: `image-${name}`,
      min: "1",
      step: "1",
      inputMode: "numeric",
      "aria-label": `${what} ${name} in pixels, for ${baseName(path)}`,
      value: entered[i],
      oninput: () => begun.set(entry, [width.value, height.value]),
      onchange: () => take(),
    }),
  );
  const take = () => {
    begun.set(entry, [width.value, height.value]);
    const size = /** @type {[number, number]} */ ([width.valueAsNumber, height.valueAsNumber]);
    const isSide = (/** @type {number} */ pixels) => Number.isInteger(pixels) && pixels > 0;
    const isEmpty = width.value === "" || height.value === "";
    const isValid = size.every(isSide);
    hint.textContent = isEmpty || isValid ? "" : "Expected whole numbers of pixels above 0.";
    for (const [i, input] of [width, height].entries()) {
      input.setAttribute("aria-invalid", String(input.value !== "" && !isSide(size[i])));
    }
    const isTakenBack = width.value === "" && height.value === "" && given !== undefined;
    if (!isValid && !isTakenBack) return;
    begun.delete(entry);
    void set(isValid ? size : undefined);
  };
  return h(
    "fieldset",
    { class: "image-size" },
    h("legend", {}, isBoard ? "Size of the simulator's board" : "Size of the images"),
    h("span", { class: "image-size-sides" }, width, "×", height, "px"),
    hint,
  );
}

export function guessMark() {
  const title = "The file does not say so; change it if it is wrong";
  return h("span", { class: "guess", title }, "assumed");
}

/**
 * What a file could be.
 * @param {Entry} entry
 * @returns {(Slot | "unknown")[]}
 */
function rolesOf(entry) {
  const { arrays, path, taken } = entry;
  /** @type {Slot[]} */
  const points = ["ground-truth", "keypoints"];
  if (taken.role === "camera") return ["camera", "unknown"];
  const isTable = arrays || tableOf(entry) || /\.(csv|tsv|txt|json)$/i.test(path);
  if (isTable) return [...points, "unknown"];
  return taken.role === "checkpoint"
    ? ["checkpoint", "unknown"]
    : [...points, "checkpoint", "unknown"];
}

/**
 * A choice with the grounds for the present value.
 * @param {string} label
 * @param {string} name
 * @param {string[][]} options value and text
 * @param {{ value: string | number | boolean, by: string }} known
 * @param {(value: string) => void} change
 */
function choice(label, name, options, { value, by }, change) {
  return h(
    "label",
    { class: "choice", data: { by } },
    h("span", {}, label),
    h(
      "select",
      {
        name,
        onchange: (/** @type {Event} */ { target }) =>
          change(/** @type {HTMLSelectElement} */ (target).value),
      },
      ...options.map(([option, text]) =>
        h("option", { value: option, selected: option === String(value) }, text),
      ),
    ),
    h("small", {}, GROUNDS[by]),
  );
}
