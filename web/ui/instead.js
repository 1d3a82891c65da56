// @ts-check
/** Views that stand in the place of the frames, each fetched when somebody asks for it. */

import { addStyle } from "./style.js";

/**
 * What opens a view, or goes back to it: there is one for every session.
 * @template {object} S
 * @param {URL} style of the view
 * @param {(session: S) => { open: () => void }} make
 * @returns {(session: S) => Promise<void>}
 */
export function opener(style, make) {
  /** @type {WeakMap<S, { open: () => void }>} */
  const views = new WeakMap();
  return async (session) => {
    await Promise.all([new URL("./instead.css", import.meta.url), style].map(addStyle));
    const view = views.get(session) ?? make(session);
    views.set(session, view);
    view.open();
  };
}
