// @ts-check
/**
 * Details that stay open when what is around is redrawn. Costly content is made when they are
 * opened.
 */

import { h } from "./dom.js";

/** Those that the user opened. @type {Set<string>} */
const opened = new Set();
/** Where they were scrolled to. @type {Map<string, number>} */
const scrolled = new Map();

/**
 * @param {string} key
 * @param {import("./dom.js").Child[]} summary
 * @param {HTMLElement | (() => HTMLElement)} content
 */
export function disclosure(key, summary, content) {
  const details = h(
    "details",
    { class: "disclosure", data: { key } },
    h("summary", {}, ...summary),
  );
  if (content instanceof HTMLElement) details.append(content);
  const remember = () => {
    if (details.open) opened.add(key);
    else opened.delete(key);
  };
  const update = () => {
    remember();
    if (!details.open || content instanceof HTMLElement) return;
    if (details.childElementCount === 1) {
      const made = content();
      details.append(made);
      made.addEventListener("scroll", () => scrolled.set(key, made.scrollTop), { passive: true });
    }
    if (details.lastElementChild) details.lastElementChild.scrollTop = scrolled.get(key) ?? 0;
  };
  details.addEventListener("toggle", () => {
    // The event comes late. Where others took the place of these details, they have the content, and
    // would lose it.
    if (details.isConnected) update();
    else remember();
  });
  details.open = opened.has(key);
  // At once, and not with the event: what is drawn anew has no gap. The event finds it in its place.
  if (details.open) update();
  return details;
}
