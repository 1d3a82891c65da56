// @ts-check
/** Numbers, counts and durations as text. */

const whole = new Intl.NumberFormat("en");

/** @param {number} value */
export function integer(value) {
  return whole.format(value);
}

/**
 * What the package says, which begins small and has no full stop, as a sentence.
 * @param {string} text
 */
export function sentence(text) {
  return `${text[0].toUpperCase()}${text.slice(1)}.`;
}

/**
 * A count with its noun.
 * @param {number} n
 * @param {string} one
 * @param {string} [many]
 */
export function count(n, one, many = `${one}s`) {
  return `${whole.format(n)} ${n === 1 ? one : many}`;
}

/**
 * Three significant digits, as decimals where that stays short: `0.0123`, `4.56e-6`.
 * @param {number | null | undefined} value
 */
export function significant(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size < 1e-4 || size >= 1e5) return value.toExponential(digits - 1).replace("-", "−");
  const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return value.toFixed(Math.min(decimals, 8)).replace("-", "−");
}

/** @param {number} value */
export function fixed(value, decimals = 2) {
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? text.replace("-", "") : text;
}

/** @param {number} seconds */
export function duration(seconds) {
  const rounded = Math.max(0, Math.round(seconds));
  if (rounded < 60) return `${rounded} s`;
  const minutes = Math.floor(rounded / 60);
  if (minutes < 60) return `${minutes} min ${String(rounded % 60).padStart(2, "0")} s`;
  return `${Math.floor(minutes / 60)} h ${String(minutes % 60).padStart(2, "0")} min`;
}

/**
 * Names in a row: `a, b, c and 5 more`.
 * @param {string[]} names the first ones
 * @param {number} [total]
 */
export function names(names, total = names.length) {
  const more = total - names.length;
  return names.join(", ") + (more > 0 ? ` and ${integer(more)} more` : "");
}

/**
 * A file's name from its path.
 * @param {string} path
 */
export function baseName(path) {
  return path.slice(path.lastIndexOf("/") + 1);
}
