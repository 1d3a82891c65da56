// @ts-check
/** A list of many rows, of which only those in view are in the document. */

import { fill, h } from "./dom.js";

/** Rows drawn above and below those in view. */
const MARGIN = 6;
/** Rows in view before the list scrolls. */
const MOST = 8;

/**
 * @param {string} label
 * @param {number} rows
 * @param {number} height of a row, in rem
 * @param {(i: number) => HTMLElement} row makes a row
 */
export function virtualList(label, rows, height, row) {
  const rail = h("div", { class: "rail" });
  const list = h(
    "div",
    {
      class: "virtual",
      role: "list",
      tabIndex: 0,
      "aria-label": label,
      data: { rows: String(rows) },
    },
    rail,
  );
  list.style.blockSize = `${Math.min(rows, MOST) * height}rem`;
  rail.style.blockSize = `${rows * height}rem`;
  let drawn = "";
  const draw = () => {
    const rem = Number.parseFloat(getComputedStyle(document.documentElement).fontSize);
    const first = Math.max(0, Math.floor(list.scrollTop / (height * rem)) - MARGIN);
    const last = Math.min(rows, first + MOST + 2 * MARGIN);
    if (drawn === `${first} ${last}`) return;
    drawn = `${first} ${last}`;
    const elements = [];
    for (let i = first; i < last; i++) {
      const element = row(i);
      element.setAttribute("role", "listitem");
      element.setAttribute("aria-posinset", String(i + 1));
      element.setAttribute("aria-setsize", String(rows));
      element.style.insetBlockStart = `${i * height}rem`;
      element.style.blockSize = `${height}rem`;
      elements.push(element);
    }
    fill(rail, ...elements);
  };
  list.addEventListener("scroll", draw, { passive: true });
  draw();
  return list;
}
