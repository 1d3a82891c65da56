// @ts-check
/** The objects that are drawn into frames. */

import { objectColor } from "../ui/palette.js";

/** @typedef {import("../session.js").Session} Session */

/** Objects that are drawn at a time. */
const MOST_TRACKS = 24;

/**
 * The objects with their keypoints, the selected one over the others. Of very many only those that
 * can be told apart are drawn, and none of those in space.
 * @param {Session} session
 * @returns {import("./scene.js").Track[]}
 */
export function tracksOf({ score }) {
  if (score.isInSpace) return [];
  const { object: selected } = score.selection;
  const others = [...score.objects.keys()].filter((object) => object !== selected);
  return [...others.slice(0, MOST_TRACKS - 1), selected].flatMap((object) => {
    const series = score.series(object);
    if (!series) return [];
    const color = objectColor(object);
    return [{ series, keypoint: score.keypointOf(object), color, isSelected: object === selected }];
  });
}
