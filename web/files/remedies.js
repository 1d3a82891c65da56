// @ts-check
/** What puts right that something is wrong with the data. */

import { reasonOf } from "../errors.js";

/**
 * @typedef {import("./library.js").Library} Library
 * @typedef {import("../pkg/index.js").Remedy} Remedy
 * @typedef {import("../pkg/index.js").TableOptions} TableOptions
 */

const UNITS = { ndc: "ndc, −1 to +1", px: "pixels", fraction: "0 to 1" };

const AXES = {
  none: "",
  x: ", x to the left",
  y: ", y up",
  xy: ", x to the left and y up",
};

/**
 * Applies a remedy to the tables in use.
 * @param {Library} library
 * @param {Remedy} remedy
 */
export function applyRemedy(library, remedy) {
  const truth = library.used("ground-truth");
  const isOfKeypoints = "side" in remedy && remedy.side === "keypoints";
  const entry = isOfKeypoints ? library.used("keypoints") : truth;
  if (!entry) return;
  const read = (/** @type {TableOptions} */ options) => {
    entry.options = { ...entry.options, ...options };
    entry.wanted = true;
    library.reopen(entry);
  };
  switch (remedy.type) {
    case "unit":
      return read({ space: remedy.space });
    case "count-from":
      return read({
        indexBase: remedy.first,
        ...(isOfKeypoints ? { firstKeypoint: remedy.first_keypoint } : {}),
      });
    case "shift-frames":
      entry.alignment = { ...entry.alignment, frames: remedy.by };
      return;
    case "shift-sequences":
      entry.alignment = { ...entry.alignment, sequences: remedy.by };
      return;
    case "axes":
      return read({ axisOrder: remedy.order, flip: remedy.flip });
    case "zero-is-missing":
      return read({ zeroIsMissing: true });
  }
}

/**
 * What makes frames and rows match of which none do, where the error says it.
 * @param {unknown} error
 * @returns {Remedy | null}
 */
export function remedyOf(error) {
  const reason = /** @type {import("../pkg/index.js").Reason | null} */ (reasonOf(error));
  if (reason?.type !== "otherNumbers") return null;
  const { frames, sequences } = reason;
  return frames === 0
    ? { type: "shift-sequences", by: sequences }
    : { type: "shift-frames", by: frames };
}

/** @param {Remedy} remedy */
export function labelOf(remedy) {
  switch (remedy.type) {
    case "unit":
      return `Read as ${UNITS[remedy.space]}`;
    case "count-from":
      return `Count from ${remedy.first}`;
    case "shift-frames":
      return `Shift the rows by ${signed(remedy.by)}`;
    case "shift-sequences":
      return `Shift the sequence numbers of the rows by ${signed(remedy.by)}`;
    case "axes":
      return `Read as (${[...remedy.order].join(", ")})${AXES[remedy.flip]}`;
    case "zero-is-missing":
      return "Take (0, 0) for missing";
  }
}

/** @param {number} by */
function signed(by) {
  return by < 0 ? `−${-by}` : `+${by}`;
}
