// @ts-check
/**
 * What the user set, kept in this browser between visits. Where nothing can be kept (private
 * windows, blocked storage) or what was kept is not understood, the page goes on with its defaults.
 */

/** A layout of its own for every version: what a later page wrote is left alone by this one. */
const KEY = "tracklens/settings/1/";

/**
 * @param {string} part
 * @returns {Record<string, any>} what was kept of a part, to be checked by whoever uses it
 */
export function load(part) {
  try {
    const kept = JSON.parse(localStorage.getItem(KEY + part) ?? "{}");
    return kept !== null && typeof kept === "object" && !Array.isArray(kept) ? kept : {};
  } catch {
    return {};
  }
}

/**
 * @param {string} part
 * @param {Record<string, unknown>} values
 * @returns {boolean} whether they are kept; where storage is full or blocked they last as long as
 * the page
 */
export function store(part, values) {
  try {
    localStorage.setItem(KEY + part, JSON.stringify(values));
    return true;
  } catch {
    return false;
  }
}
