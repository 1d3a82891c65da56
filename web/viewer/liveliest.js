// @ts-check
/** Which sequence shows most. */

/** @typedef {import("../session.js").Session} Session */

/** Objects that are looked at: among many, any few say where something moves. */
const OBJECTS = 16;

/**
 * The sequence in which the objects cover the longest paths.
 * @param {Session} session
 */
export function liveliest({ score }) {
  const objects = score.objects.slice(0, OBJECTS).map((_, object) => score.series(object)?.truth);
  let best = null;
  let longest = -1;
  for (const range of score.sequences) {
    const length = objects.reduce((sum, truth) => sum + (truth ? path(truth, range) : 0), 0);
    if (length > longest) [best, longest] = [range, length];
  }
  return best;
}

/**
 * How far an object goes in a sequence, where it is visible.
 * @param {Float64Array} points
 * @param {import("../pkg/index.js").SequenceRange} range
 */
function path(points, { start, length }) {
  let sum = 0;
  for (let t = start + 1; t < start + length; t++) {
    const step = Math.hypot(
      points[2 * t] - points[2 * t - 2],
      points[2 * t + 1] - points[2 * t - 1],
    );
    if (!Number.isNaN(step)) sum += step;
  }
  return sum;
}
