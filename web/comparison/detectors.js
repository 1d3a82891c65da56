// @ts-check
/** Detectors that are compared: how each is scored, and what makes their scores less comparable. */

import { Scoring } from "../pkg/index.js";
import { messageOf } from "../errors.js";
import { contentOf, extractionOf } from "../files/entry.js";
import { count, significant } from "../ui/format.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../files/entry.js").Entry} Entry
 * @typedef {import("../pkg/index.js").Evaluation} Evaluation
 *
 * One that is scored; `entry` is its file, when its keypoints are here.
 * @typedef {{ name: string, evaluation: Evaluation, architecture?: string, entry?: Entry }} Detector
 */

/**
 * Whether frames are left to extract with a checkpoint.
 * @param {Session} session
 * @param {Entry} entry
 */
export function isPending({ frameSources }, entry) {
  const extraction = extractionOf(entry);
  return extraction !== null && extraction.pending(frameSources).length > 0;
}

/**
 * Scores a detector with the options of the session.
 * @param {Session} session
 * @param {Entry} entry
 * @returns {{ evaluation: Evaluation | null, reason: string }}
 */
export function scoreDetector(session, entry) {
  const { truth, score } = session;
  /** @type {{ free(): void }[]} */
  const made = [];
  try {
    const scoring = truth && openDetector(session, entry, made)?.scoring;
    if (!scoring) throw new Error("no frame has keypoints");
    const { transform, rank, thresholds } = score.options;
    const known = [...thresholds].filter(([name]) => scoring.objects.includes(name));
    const options = { transform, rank, thresholds: Object.fromEntries(known) };
    return { evaluation: scoring.evaluate(options), reason: "" };
  } catch (error) {
    return { evaluation: null, reason: messageOf(error) };
  } finally {
    for (const each of made) each.free();
  }
}

/**
 * A detector joined with the ground truth; `null` while it has no keypoints.
 * @param {Session} session
 * @param {Entry} entry
 * @param {{ free(): void }[]} made gets what is to be given back
 */
export function openDetector(session, entry, made) {
  const table = tableOf(session, entry, made);
  if (!table || !session.truth) return null;
  const scoring = new Scoring(session.truth, table, undefined, undefined, session.alignment);
  made.push(scoring);
  const content = contentOf(entry);
  const config = content?.kind === "checkpoint" ? content.encoder.info.config : null;
  return { scoring, config: config ?? session.replay?.config ?? null };
}

/**
 * The keypoints of a detector.
 * @param {Session} session
 * @param {Entry} entry
 * @param {{ free(): void }[]} made gets what is to be given back
 */
function tableOf({ frames, frameSources }, entry, made) {
  const content = contentOf(entry);
  if (content?.kind === "keypoints") return content.table;
  const found = frames && extractionOf(entry)?.collect(frames, frameSources);
  if (!found) return null;
  made.push(found.table);
  if (found.selected) made.push(found.selected);
  return found.table;
}

/**
 * What evaluations differ in, so that their errors say less about the detectors.
 * @param {Detector[]} detectors
 */
export function doubtsOf(detectors) {
  const differing = (
    /** @type {string} */ what,
    /** @type {(evaluation: Evaluation) => string} */ of,
  ) => {
    const values = new Set(detectors.map(({ evaluation }) => of(evaluation)));
    return values.size > 1 ? [`${what}: ${[...values].join(", ")}`] : [];
  };
  const objects = detectors.flatMap(({ evaluation }) => evaluation.objects);
  const names = new Set(objects.map(({ name }) => name));
  const threshold = (/** @type {string} */ name) => (/** @type {Evaluation} */ evaluation) =>
    significant(evaluation.objects.find((object) => object.name === name)?.threshold);
  return [
    ...differing("These evaluations are of different numbers of frames", ({ frames }) =>
      count(frames, "frame"),
    ),
    ...differing("These evaluations differ in their rank rule", ({ rank }) => rank),
    ...[...names].flatMap((name) =>
      differing(
        `These evaluations were saved with different thresholds for ${name}; one applies to all ` +
          "here",
        threshold(name),
      ),
    ),
  ];
}
