// @ts-check
/** The sequence on display, where there are frames, as a film that plays in a report. */

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
  if (!score.scoring || !score.hasPictures || score.isInSpace || !range) return null;
  const length = Math.min(range.length, MOST_FRAMES);
  const frames = Array.from({ length }, (_, i) => range.start + i);
  const numbers = frames.map((frame) => score.frameNumbers[frame]);
  const tracks = score.objects.slice(0, MOST_OBJECTS).flatMap((object, at) => {
    const keypoint = score.keypointOf(at);
    const series = score.series(at);
    if (keypoint === null || !series) return [];
    const points = (/** @type {Float64Array} */ all) => frames.map((frame) => position(all, frame));
    return [{ object, keypoint, truth: points(series.truth), mapped: points(series.transformed) }];
  });
  const sources = frames.map((frame) => score.picture(frame));
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
 * @returns {[number, number] | null} `null` where it is not visible
 */
function position(points, frame) {
  const [x, y] = points.subarray(2 * frame, 2 * frame + 2);
  return Number.isFinite(x) && Number.isFinite(y) ? [x, y] : null;
}
