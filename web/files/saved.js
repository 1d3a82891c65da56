// @ts-check
/** Evaluations that were saved: files that the page shows again, as far as they tell. */

import init, { parseEvaluation } from "../pkg/index.js";
import { bytesOf } from "./sources.js";

/**
 * @typedef {import("../pkg/index.js").Evaluation} Evaluation
 * @typedef {import("../pkg/index.js").SequenceError} SequenceError
 */

/** What is at no frame on display. */
const NOWHERE = -1;

/** The content of a file. */
export class SavedEvaluation {
  /** @param {Evaluation} evaluation */
  constructor(evaluation) {
    this.evaluation = evaluation;
  }

  /** @param {import("./sources.js").Source} source */
  static async parse(source) {
    await init(["comparison"]);
    const evaluation = parseEvaluation(await bytesOf(source), source.path);
    const { tc } = evaluation;
    if (tc !== null && !(tc >= 0 && tc <= 1)) {
      throw new Error(`${source.path}: \`tc\` is ${tc}; expected a share from 0 to 1`);
    }
    return new SavedEvaluation(evaluation);
  }

  /** Contents of files give back what they hold in the package; this one holds nothing there. */
  free() {}

  /** What an evaluation can have and this one does not, in words. */
  get lacks() {
    const { held_out: heldOut, intervals, sequences, context, image_size: size } = this.evaluation;
    return [
      !sequences && "errors by sequence",
      !heldOut && "held-out folds",
      !intervals && "intervals",
      !context && "other metrics",
      !size && "errors in pixels",
    ].filter((text) => text !== false);
  }

  /**
   * The errors of an object by sequence, the worst one first; none for a keypoint that was not
   * saved.
   * @param {number} object
   * @param {number} keypoint
   * @returns {SequenceError[]}
   */
  errorsBySequence(object, keypoint) {
    const { objects, sequences } = this.evaluation;
    const found = sequences?.find(
      (each) => each.object === objects[object]?.name && each.keypoint === keypoint,
    );
    return (found?.errors ?? []).map(
      ({ sequence, frames, error, worst_frame: worstFrame, worst_error: worstError }) => ({
        ...{ sequence, frames, error, worstFrame, worstError },
        ...{ start: NOWHERE, length: 0, worst: NOWHERE },
      }),
    );
  }
}
