// @ts-check
/** A table whose columns have other names: which of them is what, said by the user. */

import init, { mapColumns } from "../pkg/index.js";
import { fill, h } from "../ui/dom.js";
import { bytesOf } from "./sources.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./entry.js").Entry} Entry
 * @typedef {"ground-truth" | "keypoints"} Role
 *
 * How the columns of a text are separated, and their names.
 * @typedef {{ separator: string, columns: string[] }} Header
 */

/** Enough for the first line. */
const HEAD_BYTES = 16_384;
const SEPARATORS = [",", ";", "\t"];
/** Stands for a column that is not there: all rows have the same. */
const NONE = "";

/** What is needed, by the role, each with names that it often has. @type {Record<string, RegExp>} */
const USUAL = {
  sequence: /^(seq|sequence|episode|video|clip|trial|run|folder)/i,
  frame: /^(frame|t|time|step|index|image)/i,
  object: /^(object|name|label|id|class|body)/i,
  keypoint: /^(keypoint|kp|point|index|id|n$)/i,
  x: /^(x|px|u|col|cx|pos_?x|.*[_ .]x$)/i,
  y: /^(y|py|v|row|cy|pos_?y|.*[_ .]y$)/i,
};

/**
 * Asks which column is what.
 * @param {HTMLElement} place
 * @param {Session} session
 * @param {Entry} entry
 */
export async function askColumns(place, session, entry) {
  fill(place, ...form(session, entry, await headerOf(entry)));
}

/**
 * @param {Session} session
 * @param {Entry} entry
 * @param {Header | null} header
 */
function form(session, entry, header) {
  if (!header || header.columns.length < 3) {
    return [
      h("p", { class: "file-reason" }, "Its first line does not name three columns or more."),
    ];
  }
  const select = (/** @type {string} */ name, /** @type {[string, string][]} */ choices) =>
    h(
      "select",
      { name: `column-${name}`, "aria-label": name },
      ...choices.map(([value, label]) => h("option", { value }, label)),
    );
  const role = select("role", [
    ["ground-truth", "ground truth"],
    ["keypoints", "keypoints"],
  ]);
  if (entry.taken.role === "keypoints") role.value = "keypoints";
  const fields = h("div", { class: "corrections" });
  /** @type {Map<string, HTMLSelectElement>} */
  let selects = new Map();
  const rebuild = () => {
    const point = role.value === "keypoints" ? "keypoint" : "object";
    const names = ["sequence", "frame", point, "x", "y"];
    selects = new Map(
      names.map((name) => {
        const canLack = name === "sequence" || name === point;
        const all = header.columns.map(
          (column) => /** @type {[string, string]} */ ([column, column]),
        );
        const element = select(name, canLack ? [[NONE, "the same in all rows"], ...all] : all);
        const guess = header.columns.find((column) => USUAL[name].test(column));
        element.value = guess ?? (canLack ? NONE : header.columns[0]);
        return [name, element];
      }),
    );
    fill(
      fields,
      ...[...selects].map(([name, element]) =>
        h("label", { class: "choice" }, h("span", {}, name), element),
      ),
    );
  };
  role.addEventListener("change", rebuild);
  rebuild();
  const apply = async () => {
    const chosen = new Map([...selects].map(([name, { value }]) => [name, value]));
    const blob = await renamed(entry, chosen, role.value === "keypoints");
    void session.setColumns(entry, /** @type {Role} */ (role.value), blob);
  };
  return [
    h("label", { class: "choice" }, h("span", {}, "This table has"), role),
    fields,
    h(
      "button",
      { type: "button", class: "button", name: "apply-columns", onclick: () => void apply() },
      "Read it like this",
    ),
  ];
}

/**
 * @param {Entry} entry
 * @returns {Promise<Header | null>}
 */
async function headerOf({ source }) {
  const head = new TextDecoder().decode(await bytesOf(source, HEAD_BYTES));
  const [line] = head.replace(/^\uFEFF/, "").split(/\r?\n/, 1);
  const separator = SEPARATORS.find((each) => line.includes(each));
  if (!separator) return null;
  const columns = line.split(separator).map((name) => name.trim().replace(/^"(.*)"$/, "$1"));
  return { separator, columns };
}

/**
 * The table with the names that are expected; a column that is not there is added.
 * @param {Entry} entry
 * @param {Map<string, string>} chosen the column that each expected one is
 * @param {boolean} isKeypoints
 */
async function renamed({ path, source }, chosen, isKeypoints) {
  await init(["formats"]);
  const table = mapColumns(
    await bytesOf(source),
    path,
    [...chosen.keys()],
    [...chosen.values()],
    isKeypoints,
  );
  return new Blob([/** @type {BlobPart} */ (table)]);
}
