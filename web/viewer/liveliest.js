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
  const [, axes] = score.axes;
  let best = null;
  let longest = -1;
  for (const range of score.sequences) {
    const length = objects.reduce((sum, truth) => sum + (truth ? path(truth, axes, range) : 0), 0);
    if (length > longest) [best, longest] = [range, length];
  }
  return best;
}

/**
 * How far an object goes in a sequence, where it is visible.
 * @param {Float64Array} points
 * @param {number} axes of a point
 * @param {import("../pkg/index.js").SequenceRange} range
 */
function path(points, axes, { start, length }) {
  let sum = 0;
  for (let t = start + 1; t < start + length; t++) {
    let squares = 0;
    for (let i = axes * t; i < axes * (t + 1); i++) squares += (points[i] - points[i - axes]) ** 2;
    const step = Math.sqrt(squares);
    if (!Number.isNaN(step)) sum += step;
  }
  return sum;
}
