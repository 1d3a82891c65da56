// @ts-check
/**
 * From encoded images to keypoints, whichever way they are computed. The rest of the page knows
 * only {@link Extractor}.
 */

/**
 * @typedef {import("../files/sources.js").Source} Source
 * @typedef {import("../pkg/index.js").EncoderInfo} EncoderInfo
 * @typedef {{ points: Float64Array, width: number, height: number }} Extracted
 *
 * @typedef {object} Job
 * @property {Source[]} frames
 * @property {AbortSignal} signal
 * @property {(path: string, extracted: Extracted) => void} onFrame
 * @property {(path: string, message: string) => void} onFailure a frame that has no keypoints, and
 * why
 *
 * The encoder of a checkpoint, wherever it runs. One run at a time.
 * @typedef {object} OpenEncoder
 * @property {EncoderInfo} info
 * @property {(job: Job) => Promise<void>} extract
 *   Reports every frame once, in the order of `frames`. Rejects when no frame can be extracted any
 *   more, and at once with the signal's reason when that aborts; nothing is reported after that.
 * @property {() => void} free gives back what it holds
 *
 * @typedef {object} Extractor
 * @property {(checkpoint: { path: string, blob: Blob }) => Promise<OpenEncoder>} open rejects when
 * the checkpoint cannot be used
 */

export {};
