// @ts-check
/** The part of an image that is on display. */

/**
 * `x` and `y` are the share of the image that lies in the middle of the canvas, `zoom` is 1 for all
 * of it.
 * @typedef {{ zoom: number, x: number, y: number }} View
 */

/** @type {View} */
export const WHOLE = Object.freeze({ zoom: 1, x: 0.5, y: 0.5 });

const MAX_ZOOM = 32;

/**
 * A view that shows nothing beside the image.
 * @param {View} view
 * @returns {View}
 */
function inside({ zoom, x, y }) {
  const allowed = Math.min(MAX_ZOOM, Math.max(1, zoom));
  const margin = 0.5 / allowed;
  const clamp = (/** @type {number} */ value) => Math.min(1 - margin, Math.max(margin, value));
  return { zoom: allowed, x: clamp(x), y: clamp(y) };
}

/**
 * Zooms while the point under `at` stays where it is.
 * @param {View} view
 * @param {number} factor
 * @param {{ x: number, y: number }} at share of the canvas
 */
export function zoomed(view, factor, at) {
  const zoom = Math.min(MAX_ZOOM, Math.max(1, view.zoom * factor));
  const still = (/** @type {"x" | "y"} */ axis) =>
    view[axis] + (at[axis] - 0.5) / view.zoom - (at[axis] - 0.5) / zoom;
  return inside({ zoom, x: still("x"), y: still("y") });
}

/**
 * Moves the image with the pointer.
 * @param {View} view
 * @param {{ x: number, y: number }} by share of the canvas
 */
export function panned(view, by) {
  return inside({ zoom: view.zoom, x: view.x - by.x / view.zoom, y: view.y - by.y / view.zoom });
}

/**
 * The point of the image, in ndc, that is shown at a place of the canvas.
 * @param {View} view
 * @param {{ x: number, y: number }} at share of the canvas
 */
export function pointAt(view, at) {
  const point = (/** @type {"x" | "y"} */ axis) =>
    2 * (view[axis] + (at[axis] - 0.5) / view.zoom) - 1;
  return { x: point("x"), y: point("y") };
}
