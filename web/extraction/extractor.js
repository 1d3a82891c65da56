// @ts-check
/**
 * From encoded images to keypoints, whichever way they are computed. The rest of the page knows
 * only {@link Extractor}.
 */

/**
 * @typedef {import("../files/sources.js").Source} Source
 *
 * A file with an encoder, or with a detector of any origin: an ONNX model. `settings` is JSON that
 * says what the model does not (docs/detectors.md), or empty.
 * @typedef {{ path: string, blob: Blob, settings: string }} Given
 *
 * What is known of an encoder or a detector. `config` is the configuration of an encoder; the points
 * of other detectors are ndc. `heatMaps`: whether the weights behind a keypoint can be shown;
 * `decoder`: whether an image can be made of the keypoints.
 * @typedef {import("../pkg/index.js").DetectorInfo & { decoder: boolean, heatMaps: boolean }} Info
 *
 * Keypoints of a frame, N x 2, and how sure the detector is of each, if it says so.
 * @typedef {{ points: Float64Array, confidences?: Float64Array, width: number, height: number }}
 * Extracted
 *
 * @typedef {object} Job
 * @property {Source[]} frames
 * @property {AbortSignal} signal
 * @property {(path: string, extracted: Extracted) => void} onFrame
 * @property {(path: string, message: string) => void} onFailure a frame that has no keypoints, and
 * why
 *
 * The encoder of a checkpoint, or a detector, wherever it runs. One run at a time.
 * @typedef {object} OpenEncoder
 * @property {Info} info
 * @property {(job: Job) => Promise<void>} extract
 *   Reports every frame once, in the order of `frames`. Rejects when no frame can be extracted any
 *   more, and at once with the signal's reason when that aborts; nothing is reported after that.
 * @property {() => void} free gives back what it holds
 *
 * @typedef {object} Extractor
 * @property {(checkpoint: Given) => Promise<OpenEncoder>} open rejects when the checkpoint cannot be
 * used
 */

/**
 * Whether a file is an ONNX model, by its name.
 * @param {string} path
 */
export function isModel(path) {
  return /\.onnx$/i.test(path);
}
