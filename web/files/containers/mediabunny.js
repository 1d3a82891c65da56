// @ts-check
/** Mediabunny, which reads and writes the containers of videos. */

const LIBRARY = new URL("../../vendor/mediabunny.js", import.meta.url);

/**
 * The library, fetched when it is needed first; `null` when it cannot be.
 * @returns {Promise<any>}
 */
export function mediabunny() {
  return import(LIBRARY.href).catch(() => null);
}
