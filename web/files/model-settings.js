// @ts-check
/** What an ONNX model does not say of itself: asked at its file, kept beside it, named in commands. */

import { disclosure } from "../ui/disclosure.js";
import { h } from "../ui/dom.js";
import { save } from "../ui/download.js";
import { baseName } from "../ui/format.js";
import { isModel } from "../extraction/extractor.js";
import { contentOf } from "./entry.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./entry.js").Entry} Entry
 *
 * What is said of a model, by the keys of its settings file (docs/detectors.md).
 * @typedef {Record<string, unknown>} Settings
 *
 * `missing` is its name in the reason of an error, where it is another one than `key`.
 * @typedef {{ key: string, missing?: string, label: string, options: [string, string][] }} Choice
 * @typedef {{ key: string, missing?: string, label: string, example: string,
 *   parse: (text: string) => unknown }} Entered what is typed; `parse` gives `undefined` where it is wrong
 */

/** @type {Choice[]} */
const CHOICES = [
  {
    key: "normalize",
    missing: "normalization",
    label: "Pixels are scaled",
    options: [
      ["fraction", "to 0 … 1"],
      ["symmetric", "to −1 … +1"],
      ["bytes", "to 0 … 255"],
      ["imagenet", "by ImageNet’s mean and deviation"],
    ],
  },
  {
    key: "unit",
    label: "Points are in",
    options: [
      ["px", "pixels of the input"],
      ["fraction", "0 to 1 across the image"],
      ["ndc", "−1 to +1 across the image"],
    ],
  },
  {
    key: "columns",
    label: "A point is",
    options: [
      ["xy", "x, y"],
      ["yx", "y, x"],
      ["xyc", "x, y, confidence"],
      ["yxc", "y, x, confidence"],
      ["xyz", "x, y, depth"],
    ],
  },
  {
    key: "output",
    label: "It gives",
    options: [
      ["heatmaps", "heat maps"],
      ["points", "points"],
      ["simcc", "two profiles a keypoint (SimCC)"],
    ],
  },
  {
    key: "layout",
    label: "Channels are",
    options: [
      ["nchw", "first (NCHW)"],
      ["nhwc", "last (NHWC)"],
    ],
  },
  {
    key: "channels",
    label: "Colours are",
    options: [
      ["rgb", "red, green, blue"],
      ["bgr", "blue, green, red"],
      ["gray", "grey"],
    ],
  },
  {
    key: "decode",
    label: "A map becomes a point by",
    options: [
      ["argmax", "its largest value"],
      ["softargmax", "its softmax’s mean"],
    ],
  },
];

/** @type {Entered[]} */
const ENTERED = [
  {
    key: "input_size",
    missing: "inputSize",
    label: "Frames are resized to",
    example: "256x192, or frame",
    parse: sizeOf,
  },
  {
    key: "output_names",
    missing: "outputNames",
    label: "Outputs that count",
    example: "heatmaps",
    parse: (text) => text.split(",").map((name) => name.trim()),
  },
  { key: "mean", label: "Mean of pixels in 0 … 1", example: "0.5, 0.5, 0.5", parse: numbersOf },
  { key: "std", label: "Their deviation", example: "0.5, 0.5, 0.5", parse: numbersOf },
  {
    key: "temperature",
    label: "Temperature of the softmax",
    example: "1",
    parse: (text) => numbersOf(text)?.[0],
  },
];

/**
 * What an ONNX model leaves open, and behind a disclosure all that can be said of it.
 * @param {Session} session
 * @param {Entry} entry
 */
export function modelSettings(session, entry) {
  if (!isModel(entry.path)) return [];
  const missing = missingOf(entry);
  const isMissing = (/** @type {{ key: string, missing?: string }} */ field) =>
    missing.includes(field.missing ?? field.key);
  const fields = (/** @type {boolean} */ areMissing) => [
    ...CHOICES.filter((field) => isMissing(field) === areMissing).map((field) =>
      choiceField(session, entry, field),
    ),
    ...ENTERED.filter((field) => isMissing(field) === areMissing).map((field) =>
      enteredField(session, entry, field),
    ),
  ];
  const open = fields(true);
  const isSaid = Object.keys(entry.settings).length > 0;
  return [
    open.length > 0 &&
      h(
        "fieldset",
        { class: "corrections model-settings" },
        h("legend", {}, "The model does not say"),
        ...open,
      ),
    disclosure(
      `model ${entry.path}`,
      ["How the model is run"],
      h("div", { class: "corrections model-settings" }, ...fields(false)),
    ),
    isSaid && contentOf(entry) && saveButton(entry),
  ];
}

/**
 * Settings as the package takes them.
 * @param {Settings} settings
 */
export function settingsText(settings) {
  return Object.keys(settings).length > 0 ? JSON.stringify(settings) : "";
}

/**
 * Settings as the terminal's options.
 * @param {Settings} settings
 */
export function settingsWords(settings) {
  return Object.entries(settings).flatMap(([key, value]) => {
    const isSize = key === "input_size" && Array.isArray(value);
    const word = Array.isArray(value) ? value.join(isSize ? "x" : ",") : String(value);
    // A value that begins with a minus would pass for an option.
    return [`--${key.replaceAll("_", "-")}=${word}`];
  });
}

/**
 * The settings in a file beside a model, as it was dropped.
 * @param {string} text
 * @param {string} path
 * @returns {Settings}
 */
export function parseSettings(text, path) {
  let settings;
  try {
    settings = JSON.parse(text);
  } catch {
    settings = null;
  }
  if (settings === null || typeof settings !== "object" || Array.isArray(settings)) {
    throw new Error(`${path} is not a JSON object; expected the settings of the model beside it`);
  }
  return settings;
}

/**
 * What a model leaves open, by name.
 * @param {Entry} entry
 * @returns {string[]}
 */
function missingOf({ parsed }) {
  const cause = parsed.state === "broken" ? parsed.cause : null;
  return cause?.type === "detectorSettings" ? /** @type {string[]} */ (cause.missing) : [];
}

/**
 * @param {Session} session
 * @param {Entry} entry
 * @param {Choice} choice
 */
function choiceField(session, entry, { key, label, options }) {
  const said = entry.settings[key];
  const none = /** @type {[string, string]} */ (["", "…"]);
  const select = h(
    "select",
    {
      name: key,
      onchange: () => void session.setModel(entry, { [key]: select.value || undefined }),
    },
    ...[none, ...options].map(([value, text]) =>
      h("option", { value, selected: value === (said ?? "") }, text),
    ),
  );
  return h("label", { class: "choice" }, h("span", {}, label), select);
}

/**
 * @param {Session} session
 * @param {Entry} entry
 * @param {Entered} entered
 */
function enteredField(session, entry, { key, label, example, parse }) {
  const said = entry.settings[key];
  const isSize = key === "input_size" && Array.isArray(said);
  const input = h("input", {
    type: "text",
    name: key,
    placeholder: example,
    value: Array.isArray(said) ? said.join(isSize ? "x" : ", ") : String(said ?? ""),
    onchange: () => {
      const text = input.value.trim();
      const value = text === "" ? undefined : parse(text);
      const isWrong = text !== "" && value === undefined;
      input.setAttribute("aria-invalid", String(isWrong));
      hint.textContent = isWrong ? `Expected e.g. ${example}.` : "";
      if (!isWrong) void session.setModel(entry, { [key]: value });
    },
  });
  const hint = h("small", { role: "status" });
  return h("label", { class: "choice" }, h("span", {}, label), input, hint);
}

/** @param {Entry} entry */
function saveButton({ path, settings }) {
  const name = `${baseName(path)}.json`;
  const title = "Put it beside the model: page and terminal read it from there";
  const json = `${JSON.stringify(settings, null, 2)}\n`;
  return h(
    "button",
    {
      type: "button",
      class: "link",
      title,
      onclick: () => save(name, "application/json", json),
    },
    `Save ${name}`,
  );
}

/** @param {string} text */
function sizeOf(text) {
  if (text === "frame") return text;
  const sides = /^(\d+)\s*[x×]\s*(\d+)$/i.exec(text)?.slice(1).map(Number);
  return sides?.every((side) => side > 0) ? sides : undefined;
}

/** @param {string} text */
function numbersOf(text) {
  const numbers = text.split(/[\s,;]+/).map(Number);
  return numbers.length > 0 && numbers.every(Number.isFinite) ? numbers : undefined;
}
