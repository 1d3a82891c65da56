// @ts-check
/**
 * Settings of a score in the fragment of the page's address, so that a link carries them:
 * `#map=identity&folds=5&threshold=cube:0.01`. The fragment is never sent anywhere.
 */

/**
 * @typedef {import("./score.js").Options} Options
 * @typedef {{ transform: string | null, rank: string | null, thresholds: Record<string, number>,
 * folds: number, intervals: boolean }} Settings as far as they are given, to be checked by whoever
 * uses them
 */

const KEYS = ["map", "rank", "folds", "intervals", "threshold"];

/**
 * The settings in a fragment; `null` where there are none.
 * @param {string} hash
 * @returns {Settings | null}
 */
export function settingsIn(hash) {
  const given = new URLSearchParams(hash.replace(/^#/, ""));
  if (!KEYS.some((key) => given.has(key))) return null;
  const thresholds = given.getAll("threshold").map((text) => {
    const colon = text.lastIndexOf(":");
    return /** @type {[string, number]} */ ([text.slice(0, colon), Number(text.slice(colon + 1))]);
  });
  const folds = Number(given.get("folds") ?? 0);
  return {
    transform: given.get("map"),
    rank: given.get("rank"),
    thresholds: Object.fromEntries(thresholds),
    folds: Number.isInteger(folds) && folds >= 0 ? folds : 0,
    intervals: given.has("intervals"),
  };
}

/**
 * The fragment of settings that differ from the defaults; empty where none does.
 * @param {Options} options
 * @param {{ folds: number, intervals: boolean }} resampling
 * @param {Pick<Options, "transform">} defaults
 */
export function fragmentOf(options, { folds, intervals }, defaults) {
  const kept = new URLSearchParams();
  if (options.transform !== defaults.transform) kept.set("map", options.transform);
  if (options.rank !== null) kept.set("rank", options.rank);
  if (folds > 0) kept.set("folds", String(folds));
  if (intervals) kept.set("intervals", "1");
  for (const [name, value] of options.thresholds) kept.append("threshold", `${name}:${value}`);
  return kept.size > 0 ? `#${kept}` : "";
}
