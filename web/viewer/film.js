// @ts-check
/** The sequence on display, where there are frames or points in space, as a report shows it. */

import { thumbnail } from "../files/thumbnail.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../files/sources.js").Source} Source
 * @typedef {import("../pkg/index.js").Film} Film
 */

/** Frames and objects that a report shows at the most, of which it leaves out what is too large. */
const MOST_FRAMES = 120;
const MOST_OBJECTS = 7;
/** The longer side of an image, in pixels. */
const SIDE = 256;
const QUALITY = 0.8;

/**
 * @param {Session} session
 * @returns {Promise<Film | null>}
 */
export async function filmOf({ score }) {
  const range = score.sequenceOf(score.selection.frame);
  if (!score.scoring || !range || !(score.hasPictures || score.isInSpace)) return null;
  const [, axes] = score.axes;
  const length = Math.min(range.length, MOST_FRAMES);
  const frames = Array.from({ length }, (_, i) => range.start + i);
  const numbers = frames.map((frame) => score.frameNumbers[frame]);
  const tracks = score.objects.slice(0, MOST_OBJECTS).flatMap((object, at) => {
    const keypoint = score.keypointOf(at);
    const series = score.series(at);
    if (keypoint === null || !series) return [];
    const points = (/** @type {Float64Array} */ all) =>
      frames.map((frame) => position(all, frame, axes));
    return [{ object, keypoint, truth: points(series.truth), mapped: points(series.transformed) }];
  });
  const sources = score.isInSpace ? [] : frames.map((frame) => score.picture(frame));
  const images = [];
  for (const source of sources) images.push(source && (await imageOf(source)));
  return {
    ...{ sequence: range.name, length: range.length, size: score.imageSize ?? [1, 1] },
    ...{ frames: numbers, images, tracks },
  };
}

/**
 * A frame as a data URI; `null` when it cannot be decoded.
 * @param {Source} source
 * @returns {Promise<string | null>}
 */
async function imageOf(source) {
  const blob = await thumbnail(source, SIDE, QUALITY).catch(() => null);
  if (!blob) return null;
  return new Promise((resolve) => {
    const reader = new FileReader();
    reader.onload = () => resolve(String(reader.result));
    reader.onerror = () => resolve(null);
    reader.readAsDataURL(blob);
  });
}

/**
 * @param {Float64Array} points
 * @param {number} frame
 * @param {number} axes of a position
 * @returns {number[] | null} `null` where it is not visible
 */
function position(points, frame, axes) {
  const point = [...points.subarray(axes * frame, axes * (frame + 1))];
  return point.every(Number.isFinite) ? point : null;
}
