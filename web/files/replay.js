// @ts-check
/**
 * A score as one file that drops back in as it was: a ZIP archive of the settings, the keypoints,
 * the ground truth and small images.
 */

import { version } from "../pkg/index.js";
import { baseName } from "../ui/format.js";
import { tableOf } from "./entry.js";
import { blobOf } from "./sources.js";
import { thumbnail } from "./thumbnail.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../pkg/index.js").MinConfidence} MinConfidence
 * @typedef {import("../pkg/index.js").TableOptions} TableOptions
 * @typedef {import("./sources.js").Source} Source
 *
 * What the archive says beside its files. `config` is that of the encoder whose latent space the
 * keypoints are in.
 * @typedef {{ schema: string, version: string, transform: string, rank: string | null, thresholds:
 * Record<string, number>, minConfidence?: MinConfidence, imageSize: [number, number] | null, config: string | null, truth:
 * TableOptions, keypoints: TableOptions }} Replay
 */

export const REPLAY = "tracklens.json";
const SCHEMA = "tracklens/replay/1";
/** The longer side of an image, in pixels. */
const SIDE = 192;
const QUALITY = 0.75;
/** Images are left out of longer recordings. */
const MOST_IMAGES = 4000;

/**
 * @param {Session} session
 * @param {(done: number, total: number) => void} onProgress
 * @param {AbortSignal} signal
 * @returns {Promise<Blob>}
 */
export async function replayOf(session, onProgress, signal) {
  const { score, library, table } = session;
  const truth = library.used("ground-truth");
  const keypoints = library.used("keypoints");
  const camera = library.used("camera");
  if (!score.points || !table || !truth) throw new Error("there is no score to be saved");
  const { transform, rank, thresholds } = score.options;
  const config = keypoints ? null : (session.encoder?.info.config ?? null);
  /** @type {Replay} */
  const replay = {
    ...{ schema: SCHEMA, version: version(), transform, rank },
    thresholds: Object.fromEntries(thresholds),
    minConfidence: session.minConfidence,
    imageSize: score.imageSize,
    config: config ?? session.replay?.config ?? null,
    truth: readingOf(truth),
    // As a table it is written in ndc, counted from 0.
    keypoints: {},
  };
  const text = new Blob([`${JSON.stringify(replay, null, 2)}\n`]);
  const files = [
    { path: REPLAY, blob: text },
    { path: baseName(truth.source.path), blob: await blobOf(truth.source) },
    { path: "keypoints.csv", blob: new Blob([table.toCsv()]) },
    ...(camera ? [{ path: baseName(camera.path), blob: await blobOf(camera.source) }] : []),
    ...(await imagesOf(session, onProgress, signal)),
  ];
  const { zipOf } = await import("./containers/zip-writer.js");
  return zipOf(files);
}

/**
 * How a table was read: what was guessed then is said now.
 * @param {import("./entry.js").Entry} entry
 * @returns {TableOptions}
 */
function readingOf(entry) {
  const table = tableOf(entry);
  if (!table) return {};
  const { space, axisOrder, indexBase } = table.reading;
  return {
    // Positions in space have the unit of their file.
    ...(table.axes === 2 ? { space: space.value } : {}),
    ...(entry.options.xyOnly ? { xyOnly: true } : {}),
    ...{ axisOrder: axisOrder.value, indexBase: indexBase.value },
  };
}

/**
 * @param {Session} session
 * @param {(done: number, total: number) => void} onProgress
 * @param {AbortSignal} signal
 */
async function imagesOf({ score, frameSources }, onProgress, signal) {
  const frames = [...score.frameNumbers.keys()];
  const shown = new Set(frames.map((frame) => score.picture(frame)));
  const images = frameSources.filter((source) => shown.has(source));
  if (images.length > MOST_IMAGES) return [];
  const files = [];
  for (const [i, source] of images.entries()) {
    signal.throwIfAborted();
    onProgress(i, images.length);
    const blob = await thumbnail(source, SIDE, QUALITY).catch(() => null);
    if (blob) files.push({ path: `${source.path.replace(/\.[^./]*$/, "")}.jpg`, blob });
  }
  return files;
}

/**
 * What a file says of how to show the others; `null` when it is something else.
 * @param {Source} source
 * @returns {Promise<Replay | null>}
 */
export async function readReplay(source) {
  try {
    const found = JSON.parse(await (await blobOf(source)).text());
    return found?.schema === SCHEMA ? found : null;
  } catch {
    return null;
  }
}
