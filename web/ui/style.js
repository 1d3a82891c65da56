// @ts-check
/** Style sheets of parts that are fetched when they are asked for. */

/** @type {Map<string, Promise<void>>} */
const loading = new Map();

/**
 * Adds a style sheet to the page, once; without it the part is there, but plain.
 * @param {URL} url
 * @returns {Promise<void>}
 */
export function addStyle({ href }) {
  let added = loading.get(href);
  if (!added) {
    const link = Object.assign(document.createElement("link"), { rel: "stylesheet", href });
    added = new Promise((resolve) => {
      link.onload = () => resolve();
      link.onerror = () => resolve();
    });
    loading.set(href, added);
    document.head.append(link);
  }
  return added;
}
