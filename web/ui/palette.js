// @ts-check
/**
 * Colours that tell objects apart for everyone, after M. Okabe and K. Ito. They lie on images with
 * a dark outline, so they are the same under light and dark schemes.
 */

const COLORS = ["#e69f00", "#56b4e9", "#cc79a7", "#009e73", "#f0e442", "#d55e00", "#0072b2"];

/** @param {number} object */
export function objectColor(object) {
  return COLORS[object % COLORS.length];
}
