// @ts-check
/** Two to four detectors that play in step: the frame on display, once for each. */

import { ImageCache } from "../files/image-cache.js";
import { Points } from "../points.js";
import { fill, h } from "../ui/dom.js";
import { baseName } from "../ui/format.js";
import { objectColor } from "../ui/palette.js";
import { onResized } from "../ui/resized.js";
import { paint } from "../viewer/scene.js";
import { WHOLE } from "../viewer/view.js";
import { openDetector } from "./detectors.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./comparison.js").RunsComparison} RunsComparison
 * @typedef {import("./detectors.js").Detector} Detector
 *
 * @typedef {object} Lane
 * @property {Detector} detector
 * @property {Points} points
 * @property {Map<string, number>} frames its frames by sequence and number
 * @property {HTMLCanvasElement} canvas
 */

const MOST = 4;
/** Objects that are drawn in each frame. */
const OBJECTS = 12;
/** Frames that a trail reaches back. */
const TRAIL = 25;
/** @type {Set<import("../viewer/scene.js").Layer>} */
const LAYERS = new Set(["truth", "transformed", "trails"]);

/**
 * @param {Session} session
 * @param {RunsComparison} comparison
 */
export function inStepView(session, comparison) {
  const cache = new ImageCache();
  const grid = h("ul", { class: "in-step" });
  const note = h("p", { class: "hint-line" });
  /** @type {Lane[]} */
  let lanes = [];
  /** @type {{ free(): void }[]} */
  let made = [];
  /** What the lanes are of. */
  let shown = "";

  const close = () => {
    for (const each of made.reverse()) each.free();
    [lanes, made, shown] = [[], [], ""];
    cache.clear();
  };
  const draw = async () => {
    const { frame } = session.score.selection;
    const source = session.score.picture(frame);
    const image = source ? await cache.load(source) : null;
    if (frame !== session.score.selection.frame) return;
    for (const lane of lanes) drawLane(session, lane, frame, image);
  };
  const update = () => {
    const detectors = comparison.detectors.slice(0, MOST);
    element.hidden = detectors.length < 2 || !session.score.scoring;
    if (element.hidden || !element.open) {
      close();
      return;
    }
    const next = JSON.stringify([detectors.map(({ name }) => name), session.score.options]);
    if (next !== shown) {
      close();
      shown = next;
      lanes = detectors.flatMap((detector) => laneOf(session, detector, made));
      fill(grid, ...lanes.map(({ detector, canvas }) => laneView(detector, canvas)));
    }
    note.textContent =
      "Truth as circles, the best keypoints under their maps as diamonds; they follow the player " +
      `above.${comparison.detectors.length > MOST ? ` The first ${MOST} are shown.` : ""}`;
    void draw();
  };
  const element = h(
    "details",
    { id: "in-step", class: "panel", ontoggle: () => update() },
    h("summary", {}, "Play them in step"),
    note,
    grid,
  );
  onResized(grid, () => lanes.length > 0 && void draw());
  session.score.addEventListener("selection", () => lanes.length > 0 && void draw());
  return { element, update };
}

/**
 * @param {Session} session
 * @param {Detector} detector
 * @param {{ free(): void }[]} made
 * @returns {Lane[]}
 */
function laneOf(session, detector, made) {
  const opened = detector.entry && openDetector(session, detector.entry, made);
  if (!opened) return [];
  const { scoring, config } = opened;
  const { sequences, frameNumbers } = scoring;
  const sizes = session.frameSize ? [session.frameSize] : [];
  const points = new Points({ scoring, sequences, frameNumbers, pictures: [], sizes, config });
  const frames = new Map(
    sequences.flatMap(({ name, start, length }) =>
      Array.from({ length }, (_, i) => [`${name} ${frameNumbers[start + i]}`, start + i]),
    ),
  );
  const canvas = h("canvas", { class: "stage", role: "img", "aria-label": baseName(detector.name) });
  return [{ detector, points, frames, canvas }];
}

/**
 * @param {Detector} detector
 * @param {HTMLCanvasElement} canvas
 */
function laneView({ name }, canvas) {
  return h("li", {}, h("p", { class: "small-title" }, baseName(name)), canvas);
}

/**
 * @param {Session} session
 * @param {Lane} lane
 * @param {number} shown the frame on display, by the frames of the session
 * @param {ImageBitmap | null} image
 */
function drawLane({ score }, { detector, points, frames, canvas }, shown, image) {
  const sequence = score.sequenceOf(shown);
  const frame = frames.get(`${sequence?.name} ${score.frameNumbers[shown]}`);
  const { width = 1, height = 1 } = image ?? {};
  canvas.style.aspectRatio = `${width} / ${height}`;
  const ratio = window.devicePixelRatio;
  const size = { width: canvas.clientWidth, height: canvas.clientHeight };
  if (size.width === 0) return;
  Object.assign(canvas, {
    width: Math.round(size.width * ratio),
    height: Math.round(size.height * ratio),
  });
  canvas.dataset.frame = frame === undefined ? "" : String(shown);
  const context = canvas.getContext("2d");
  if (!context) return;
  const { transform, rank } = score.options;
  const tracks = points.objects.slice(0, OBJECTS).flatMap((_, object) => {
    const keypoint = detector.evaluation.objects[object]?.best_keypoint ?? null;
    if (keypoint === null || frame === undefined) return [];
    const series = points.series(object, keypoint, { transform, rank });
    const isSelected = object === score.selection.object;
    return series ? [{ series, keypoint, color: objectColor(object), isSelected }] : [];
  });
  const start = points.sequenceOf(frame ?? 0)?.start ?? 0;
  paint(context, ratio, {
    image,
    caption: frame === undefined ? "no keypoints of this frame" : "",
    view: WHOLE,
    tracks,
    start: Math.max(start, (frame ?? 0) - TRAIL),
    frame: frame ?? 0,
    layers: LAYERS,
    keypoints: new Float64Array(),
    hovered: null,
    heat: null,
  });
}
