// @ts-check
/** Marks that outlast the page: they are kept in this browser, by the images that they are of. */

import { load, store } from "../settings.js";

/**
 * @typedef {import("./marks.js").Mark} Mark
 * @typedef {import("./marks.js").State} State
 * @typedef {{ id: string, objects: string[], frames: [string, (Mark | null)[]][] }} Kept
 */

const PART = "marks";
/** Sets of images whose marks are kept. */
const MOST = 5;

/**
 * What tells images from others, as far as their outside does.
 * @param {import("../session.js").Session} session
 */
function idOf({ frames, frameSources, frameSize }) {
  const first = frameSources[0];
  const bytes = first && "blob" in first ? first.blob.size : 0;
  const text = JSON.stringify([frames?.sequences, frameSize, bytes]);
  let hash = 0;
  for (let i = 0; i < text.length; i++) hash = (Math.imul(hash, 31) + text.charCodeAt(i)) | 0;
  return `${frameSources.length} ${hash}`;
}

/** @returns {Kept[]} */
function all() {
  const { sets } = load(PART);
  return Array.isArray(sets) ? sets : [];
}

/**
 * The marks of these images, if there are any.
 * @param {import("../session.js").Session} session
 * @returns {State | null}
 */
export function keptMarks(session) {
  const id = idOf(session);
  const kept = all().find((set) => set.id === id);
  if (!Array.isArray(kept?.objects) || !Array.isArray(kept.frames)) return null;
  return { objects: kept.objects, frames: new Map(kept.frames) };
}

/**
 * @param {import("../session.js").Session} session
 * @param {State} state
 * @returns {boolean} whether they will be there on the next visit
 */
export function keepMarks(session, { objects, frames }) {
  const id = idOf(session);
  const others = all().filter((set) => set.id !== id);
  /** @type {Kept} */
  const kept = {
    id,
    objects: [...objects],
    frames: [...frames].map(([key, marks]) => [key, [...marks]]),
  };
  const isEmpty = frames.size === 0;
  return store(PART, { sets: isEmpty ? others : [kept, ...others].slice(0, MOST) });
}
