// @ts-check
/** Many objects: a table of which only the rows in sight are elements, the worst ones first. */

import { fill, h, icon } from "../ui/dom.js";
import { significant } from "../ui/format.js";
import { objectColor } from "../ui/palette.js";
import { onResized } from "../ui/resized.js";
import { isJudged } from "./cards.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {"name" | "error"} Order
 */

/** Height of a row, in the size of the page's text. */
const ROW_REM = 1.875;
/** Rows that are there beyond those in sight. */
const BEYOND = 6;

/** @param {Session} session */
export function objectTable(session) {
  const { score } = session;
  /** Objects in the order of the table. @type {number[]} */
  let order = [];
  /** @type {Order} */
  let by = "error";
  const rows = h("div", { class: "object-rows", role: "rowgroup" });
  const { head, sorting } = headView((key) => {
    by = key;
    update();
  });
  const element = h(
    "div",
    {
      id: "object-table",
      class: "object-table",
      role: "table",
      tabIndex: 0,
      "aria-label": "Objects",
      onscroll: () => draw(),
    },
    h("div", { role: "rowgroup" }, head),
    rows,
  );

  let rowHeight = 30;
  const draw = () => {
    const first = Math.max(0, Math.floor(element.scrollTop / rowHeight) - BEYOND);
    const inSight = Math.ceil(element.clientHeight / rowHeight) + 2 * BEYOND;
    const focused = /** @type {HTMLElement | null} */ (document.activeElement)?.dataset.object;
    const shown = order.slice(first, first + inSight);
    fill(rows, ...shown.map((object, i) => rowView(session, object, first + i, rowHeight)));
    if (focused !== undefined && !document.activeElement?.isConnected) element.focus();
  };
  const update = () => {
    const objects = score.evaluation?.objects;
    if (!objects) return;
    order = [...objects.keys()];
    const errorOf = (/** @type {number} */ object) => objects[object].error ?? Infinity;
    if (by === "error") order.sort((a, b) => errorOf(b) - errorOf(a));
    for (const { key, header } of sorting) {
      const direction = key === "error" ? "descending" : "ascending";
      header.setAttribute("aria-sort", key === by ? direction : "none");
    }
    rowHeight = ROW_REM * parseFloat(getComputedStyle(document.documentElement).fontSize);
    element.setAttribute("aria-rowcount", String(order.length + 1));
    rows.style.height = `${order.length * rowHeight}px`;
    draw();
  };
  onResized(element, draw);
  return { element, update };
}

/**
 * The headers, two of which sort.
 * @param {(key: Order) => void} sort
 */
function headView(sort) {
  const sorting = /** @type {[Order, string][]} */ ([
    ["name", "Object"],
    ["error", "Error e"],
  ]).map(([key, label]) => {
    const onclick = () => sort(key);
    const button = h("button", { type: "button", class: "sort", onclick }, label);
    return { key, header: h("span", { role: "columnheader" }, button) };
  });
  const plain = ["Held out", "RMSE, px", "Keypoint", "Threshold μ", ""].map((label) =>
    h("span", { role: "columnheader" }, label || h("span", { class: "visually-hidden" }, "Verdict")),
  );
  const headers = [...sorting.map(({ header }) => header), ...plain];
  return { head: h("div", { class: "object-row object-head", role: "row" }, ...headers), sorting };
}

/**
 * @param {Session} session
 * @param {number} object
 * @param {number} position
 * @param {number} height
 */
function rowView({ score }, object, position, height) {
  const result = score.evaluation?.objects[object];
  const beside = score.evaluation?.held_out?.objects[object];
  const { name = "", error = null, rmse_px: pixels, best_keypoint: best = null } = result ?? {};
  const swatch = h("span", { class: "object-swatch", "aria-hidden": "true" });
  swatch.style.background = objectColor(object);
  const isSelected = score.selection.object === object;
  const show = h(
    "button",
    {
      type: "button",
      class: "card-show",
      "aria-pressed": String(isSelected),
      onclick: () => score.select({ object }),
    },
    name,
  );
  const isKnown = score.evaluation ? isJudged(score.evaluation, object) : true;
  const isTracked = error === null || !isKnown ? "none" : String(result?.tracked);
  const symbol = { true: "icon-check", false: "icon-cross", none: "icon-none" }[isTracked];
  const unseen = error === null ? "Never visible" : "Too few frames";
  const verdict = { true: "Tracked", false: "Not tracked", none: unseen }[isTracked];
  const texts = [
    significant(error),
    significant(beside?.error),
    significant(pixels),
    best === null ? "–" : `no. ${best}`,
    significant(result?.threshold),
  ];
  const row = h(
    "div",
    {
      class: "object-row",
      role: "row",
      "aria-rowindex": String(position + 2),
      data: { object: name, tracked: isTracked, error: String(error) },
    },
    h("span", { class: "card-name", role: "rowheader" }, swatch, show),
    ...texts.map((text) => h("span", { role: "cell" }, text)),
    h(
      "span",
      { role: "cell", class: "verdict", data: { tracked: isTracked }, title: verdict },
      icon(symbol ?? "icon-none"),
      h("span", { class: "visually-hidden" }, verdict),
    ),
  );
  row.style.top = `${position * height}px`;
  return row;
}
