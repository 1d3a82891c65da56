// @ts-check
/** The tables of a comparison. */

import { fill, h } from "../ui/dom.js";
import { scrollRegion } from "../ui/scroll-region.js";

/**
 * @typedef {import("../pkg/index.js").Table} Table
 * @typedef {import("../pkg/index.js").TableCell} TableCell
 * @typedef {{ column: number, down: boolean }} Order
 */

/** Tables that can be sorted. @type {Table["name"][]} */
const SORTED = ["runs", "agents"];

/** The ids of tables. @type {Map<Table["name"], string>} */
const IDS = new Map([
  ["errors", "error-table"],
  ["runs", "run-table"],
]);

/**
 * A table with its caption and note.
 * @param {Table} table
 * @param {Map<Table["name"], Order>} orders by what tables are sorted that can be sorted
 */
export function tableView(table, orders) {
  const isSorted = SORTED.includes(table.name);
  const order = orders.get(table.name) ?? { column: 0, down: false };
  orders.set(table.name, order);
  const body = h("tbody");
  const headers = table.columns.map(({ label, isText }, i) =>
    h(
      "th",
      { scope: "col", class: isText ? "text" : "" },
      isSorted ? sortButton(label, () => sortBy(i)) : label,
    ),
  );
  const show = () => {
    const rows = isSorted ? sorted(table.rows, order) : table.rows;
    fill(body, ...rows.map((row, i) => rowView(table, row, i > 0 ? rows[i - 1] : null)));
    headers.forEach((header, i) => {
      header.removeAttribute("aria-sort");
      const direction = order.down ? "descending" : "ascending";
      if (isSorted && i === order.column) header.setAttribute("aria-sort", direction);
    });
  };
  const sortBy = (/** @type {number} */ column) => {
    order.down = order.column === column && !order.down;
    order.column = column;
    show();
  };
  show();
  const id = IDS.get(table.name) ?? `${table.name}-table`;
  const head = h("thead", {}, h("tr", {}, ...headers));
  const element = h("table", { id, class: "runs-table" }, head, body);
  const tall = isSorted ? "table-scroll tall" : "table-scroll";
  return [
    h("h3", {}, table.caption),
    table.note && h("p", { class: "hint-line" }, table.note),
    scrollRegion(h("div", { class: tall }, element), table.caption),
  ];
}

/**
 * @param {string} label
 * @param {() => void} onclick
 */
function sortButton(label, onclick) {
  return h("button", { type: "button", class: "sort", onclick }, label);
}

/**
 * @param {Table} table
 * @param {TableCell[]} row
 * @param {TableCell[] | null} above a group is named in its first row
 */
function rowView({ columns }, row, above) {
  const cells = row.map((cell, i) => {
    const { isText, isGroup } = columns[i];
    const isRepeated = isGroup && above?.[i].text === cell.text;
    const classes = [isText && "text", cell.emphasis].filter(Boolean).join(" ");
    const content = isRepeated ? [] : contentOf(cell);
    return h(i === 0 ? "th" : "td", { class: classes, scope: i === 0 ? "row" : null }, ...content);
  });
  return h("tr", { data: { run: row[0].text } }, ...cells);
}

/** @param {TableCell} cell */
function contentOf({ text, small, details }) {
  return [
    text,
    small !== null && h("small", {}, ` ${small}`),
    ...details.flatMap((detail) => [h("br"), h("small", {}, detail)]),
  ];
}

/**
 * Rows by the value in a column; those without one are last either way.
 * @param {TableCell[][]} rows
 * @param {Order} order
 */
function sorted(rows, { column, down }) {
  return [...rows].sort((a, b) => {
    const [x, y] = [a[column]?.value ?? null, b[column]?.value ?? null];
    if (x === null || y === null) return x === y ? 0 : x === null ? 1 : -1;
    const difference =
      typeof x === "number" && typeof y === "number"
        ? x - y
        : String(x).localeCompare(String(y), "en", { numeric: true });
    return down ? -difference : difference;
  });
}
