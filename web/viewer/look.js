// @ts-check
/** How the viewer shows frames: layers, trails and speed, kept between visits. */

import { load, store } from "../settings.js";

/**
 * @typedef {import("./scene.js").Layer} Layer
 * @typedef {{ layers: Set<Layer>, trail: number, speed: number }} Look `trail`: how many frames
 * back
 */

/** Frames that a trail reaches back. @type {[number, string][]} */
export const TRAILS = [
  [5, "5 frames"],
  [10, "10 frames"],
  [25, "25 frames"],
  [100, "100 frames"],
  [Infinity, "from the start"],
];

/** @type {[Layer, string][]} */
export const LAYERS = [
  ["truth", "ground truth"],
  ["keypoint", "keypoint"],
  ["transformed", "mapped"],
  ["keypoints", "all keypoints"],
  ["trails", "trails"],
  ["heat", "heat map"],
  ["image", "reconstruction"],
];

/** What was set on the last visit, as far as it is understood. @returns {Look} */
export function loadLook() {
  const stored = load("viewer");
  const names = LAYERS.map(([layer]) => layer);
  const kept = Array.isArray(stored.layers)
    ? names.filter((layer) => stored.layers.includes(layer))
    : null;
  const lengths = TRAILS.map(([frames]) => frames);
  const trail = stored.trail === null ? Infinity : stored.trail;
  return {
    layers: new Set(kept ?? names.filter((layer) => layer !== "heat" && layer !== "image")),
    trail: lengths.includes(trail) ? trail : 25,
    speed: stored.speed > 0 && stored.speed <= 240 ? Number(stored.speed) : 5,
  };
}

/** @param {Look} look */
export function keepLook({ layers, trail, speed }) {
  store("viewer", {
    layers: [...layers],
    trail: Number.isFinite(trail) ? trail : null,
    speed,
  });
}
