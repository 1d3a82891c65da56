// @ts-check
/** What a plot of x(t), y(t), z(t) or the error over a sequence shows. */

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../score.js").Score} Score
 * @typedef {import("../pkg/index.js").LineFigure} LineFigure
 * @typedef {"x" | "y" | "z" | "error"} Quantity
 * @typedef {Record<"truth" | "keypoint" | "transformed" | "error" | "foreground" | "background" |
 * "grid", string>} Colors
 *
 * A line: the value at each scored frame.
 * @typedef {{ label: string, mark: keyof Colors, value: (frame: number) => number }} Line
 *
 * A figure with the positions of the frames on the axis, and the first position that it shows.
 * @typedef {{ figure: LineFigure, at: number[], from: number, marks: (keyof Colors)[] }} Plot
 */

/** @type {readonly Quantity[]} */
const COORDINATES = ["x", "y", "z"];
/** Frame numbers further apart than this many times their count are drawn one after the other. */
const MAX_STRETCH = 20;

/**
 * @param {Session} session
 * @param {Quantity} quantity
 * @param {Colors} colors
 * @param {number} fontSize
 * @param {{ from: number, to: number }} [time] positions to show; all where it is not given
 * @returns {Plot | null}
 */
export function describe(session, quantity, colors, fontSize, time) {
  const { score } = session;
  const { frame } = score.selection;
  const sequence = score.sequenceOf(frame);
  const lines = quantity === "error" ? errorLines(score) : pathLines(score, quantity);
  if (!sequence || !lines) return null;
  const end = sequence.start + sequence.length;
  const { start, at } = axisOf(score.frameNumbers.subarray(sequence.start, end));
  const from = time?.from ?? 0;
  const length = Math.min(time?.to ?? Infinity, at[at.length - 1]) - from + 1;
  const series = lines.map(({ label, mark, value }) => {
    const values = new Float64Array(length).fill(NaN);
    at.forEach((position, i) => {
      const shown = position - from;
      if (shown >= 0 && shown < length) values[shown] = value(sequence.start + i);
    });
    return { label, color: colors[mark], values };
  });
  const isError = quantity === "error";
  const figure = {
    title: isError ? "squared distance" : `${quantity} of ${objectName(session)}`,
    xLabel: "frame",
    yLabel: yLabelOf(score, quantity),
    start: start + from,
    series,
    cursor: at[frame - sequence.start] - from,
    fromZero: isError,
    foreground: colors.foreground,
    background: colors.background,
    grid: colors.grid,
    fontSize,
  };
  return { figure, at, from, marks: lines.map(({ mark }) => mark) };
}

/**
 * @param {Score} score
 * @param {Quantity} quantity
 */
function yLabelOf(score, quantity) {
  if (quantity === "error") return score.isInSpace ? "e (squared unit)" : "e (ndc²)";
  return score.isInSpace ? quantity : `${quantity} (ndc)`;
}

/**
 * The squared distance of the mapped keypoint from the truth, under the threshold; null where there
 * is no evaluation yet.
 * @param {Score} score
 * @returns {Line[] | null}
 */
function errorLines(score) {
  const { judged, selection } = score;
  const series = score.series(selection.object);
  if (!judged || !series) return null;
  const { threshold } = judged.objects[selection.object];
  return [
    { label: "threshold", mark: "foreground", value: () => threshold },
    { label: "error", mark: "error", value: (t) => series.distances[t] },
  ];
}

/**
 * A coordinate of the keypoint, where there is one like the object's, of the truth and of the mapped
 * keypoint; null where they have no such coordinate.
 * @param {Score} score
 * @param {Exclude<Quantity, "error">} quantity
 * @returns {Line[] | null}
 */
function pathLines(score, quantity) {
  const { object } = score.selection;
  const series = score.series(object);
  const axis = COORDINATES.indexOf(quantity);
  const [ofKeypoint, ofObject] = score.axes;
  if (!series || axis >= ofObject) return null;
  const of = (/** @type {Float64Array} */ points) => (/** @type {number} */ t) =>
    points[ofObject * t + axis];
  const keypoint = score.keypointOf(object);
  /** @type {Line} */
  const truth = { label: "truth", mark: "truth", value: of(series.truth) };
  if (keypoint === null) return [truth];
  /** @type {Line} */
  const mapped = { label: "mapped", mark: "transformed", value: of(series.transformed) };
  // In the image and in space no axis is common.
  if (ofKeypoint !== ofObject) return [truth, mapped];
  return [
    { label: `keypoint ${keypoint}`, mark: "keypoint", value: of(series.keypoint) },
    truth,
    mapped,
  ];
}

/**
 * Where each frame of a sequence stands on the axis. Missing frames leave gaps, unless most are
 * missing.
 * @param {Float64Array} numbers
 */
export function axisOf(numbers) {
  const start = numbers[0];
  const span = numbers[numbers.length - 1] - start + 1;
  const increasing = numbers.every((number, i) => i === 0 || number > numbers[i - 1]);
  const dense = increasing && span <= MAX_STRETCH * numbers.length;
  return {
    start: dense ? start : 0,
    at: Array.from(numbers, (number, i) => (dense ? number - start : i)),
  };
}

/** @param {Session} session */
export function objectName(session) {
  return session.score.objects[session.score.selection.object] ?? "";
}
