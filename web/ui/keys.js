// @ts-check
/** Keys of a part of the page. */

import { h } from "./dom.js";

/**
 * Listens to keys that no control takes.
 * @param {HTMLElement} place
 * @param {(event: KeyboardEvent) => boolean} take whether the key was one of those known
 */
export function listenToKeys(place, take) {
  place.addEventListener("keydown", (event) => {
    const { target, key } = event;
    const isModified = event.ctrlKey || event.altKey || event.metaKey;
    if (isModified || target instanceof HTMLSelectElement) return;
    if (target instanceof HTMLInputElement && target.type !== "range") return;
    const presses =
      target instanceof HTMLButtonElement ||
      (target instanceof HTMLElement && target.tagName === "SUMMARY");
    if (presses && key === " ") return;
    if (take(event)) event.preventDefault();
  });
}

/**
 * What keys do, as a list.
 * @param {string[][]} keys with what they do
 */
export function keysView(keys) {
  const rows = keys.map(([names, what]) => h("div", {}, h("dt", {}, names), h("dd", {}, what)));
  return h("dl", {}, ...rows);
}
