// @ts-check
/**
 * What can be looked at before there is a score: the images, the ground truth, and the keypoints
 * that are extracted so far.
 */

import { KeypointTable, Scoring } from "./pkg/index.js";
import { Points } from "./points.js";

/**
 * @typedef {import("./session.js").Session} Session
 * @typedef {import("./extraction/extraction.js").Extraction} Extraction
 * @typedef {import("./pkg/index.js").FrameIndex} FrameIndex
 */

/**
 * The images with what is known of them; `null` where there is none.
 * @param {Session} session
 * @param {{ free(): void }[]} made gets what is to be given back
 */
export function previewOf(session, made) {
  const { frames, frameSources, frameSize, extraction, encoder } = session;
  if (!frames) return null;
  const sizes = frameSize ? [frameSize] : [];
  const scoring = scoringOf(session, frames, made);
  if (!scoring) {
    const frameNumbers = Float64Array.from(frameSources, ({ path }) => numberIn(path));
    const { sequences } = frames;
    const parts = { scoring, sequences, frameNumbers, pictures: frameSources, sizes };
    return new Points({ ...parts, config: null });
  }
  const { sequences, frameNumbers } = scoring;
  const pictures = Array.from(scoring.imagesFrom(frames), (at) => frameSources[at] ?? null);
  const config = extraction?.extracted.size ? (encoder?.info.config ?? null) : null;
  return new Points({ scoring, sequences, frameNumbers, pictures, sizes, config });
}

/**
 * The ground truth with the keypoints so far; those of other frames are missing. Without any, a
 * point in the middle stands in for them, which is not shown.
 * @param {Session} session
 * @param {FrameIndex} frames
 * @param {{ free(): void }[]} made
 */
function scoringOf({ truth, alignment, frameSources, extraction, encoder }, frames, made) {
  if (!truth) return null;
  const isStarted = extraction !== null && extraction.extracted.size > 0 && encoder !== null;
  const keypoints = isStarted ? encoder.info.keypoints : 1;
  const points = new Float64Array(frameSources.length * keypoints * 2).fill(isStarted ? NaN : 0);
  for (const [i, { path }] of frameSources.entries()) {
    const found = isStarted && extraction.extracted.get(path);
    if (found) points.set(found.points, i * keypoints * 2);
  }
  try {
    const table = KeypointTable.fromExtraction(frames, points, keypoints);
    made.push(table);
    const scoring = new Scoring(truth, table, undefined, undefined, alignment);
    made.push(scoring);
    return scoring;
  } catch {
    // No frame has a row, which is said where frames and rows are joined.
    return null;
  }
}

/**
 * The frames that have keypoints already, scored alone; `null` while there are none.
 * @param {Session} session
 * @param {{ free(): void }[]} made gets what is to be given back
 */
export function judgeOf({ truth, alignment, frames, frameSources, extraction }, made) {
  if (!truth || !frames || !extraction?.extracted.size) return null;
  const found = extraction.collect(frames, frameSources);
  if (!found) return null;
  if (found.selected) made.push(found.selected);
  made.push(found.table);
  try {
    const scoring = new Scoring(truth, found.table, undefined, undefined, alignment);
    made.push(scoring);
    return scoring;
  } catch {
    // None of these frames has a row.
    return null;
  }
}

/**
 * The last number in a file's name.
 * @param {string} path
 */
function numberIn(path) {
  const name = path.slice(path.lastIndexOf("/") + 1);
  return Number(name.match(/\d+(?=\D*$)/)?.[0] ?? 0);
}
