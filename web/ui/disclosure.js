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
  const update = () => {
    if (details.open) opened.add(key);
    else opened.delete(key);
    if (!details.open || content instanceof HTMLElement || details.childElementCount > 1) return;
    const made = content();
    details.append(made);
    made.scrollTop = scrolled.get(key) ?? 0;
    made.addEventListener("scroll", () => scrolled.set(key, made.scrollTop), { passive: true });
  };
  details.addEventListener("toggle", update);
  details.open = opened.has(key);
  return details;
}
