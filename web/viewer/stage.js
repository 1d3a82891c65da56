// @ts-check
/** The frame on display: its image, its points, what the pointer is over. */

import { h } from "../ui/dom.js";
import { baseName, fixed } from "../ui/format.js";
import { ImageCache } from "../files/image-cache.js";
import { gestures } from "./gestures.js";
import { Inside } from "./inside.js";
import { paint, placing } from "./scene.js";
import { WHOLE } from "./view.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./scene.js").Layer} Layer
 * @typedef {{ layers: Set<Layer>, trail: number }} Look `trail`: how many frames back
 */

/** A keypoint is under the pointer from this far on, in CSS pixels. */
const REACH = 12;

/**
 * @param {Session} session
 * @param {Look} look
 * @param {(message: string) => void} onProblem why there is no heat map or reconstruction; empty
 * when there is one
 */
export function stage(session, look, onProblem) {
  const cache = new ImageCache();
  const canvas = h("canvas", { id: "stage", class: "stage", role: "img", tabIndex: 0 });
  let view = WHOLE;
  /** @type {number | null} */
  let hovered = null;
  /** All keypoints of a frame. @type {{ frame: number, points: Float64Array }} */
  let keypoints = { frame: -1, points: new Float64Array() };

  const inside = new Inside((problem) => {
    onProblem(problem);
    schedule();
  });
  const decoded = h("canvas", { id: "reconstruction", class: "stage", role: "img" });
  const reconstruction = h(
    "figure",
    { class: "reconstruction", hidden: true },
    decoded,
    h("figcaption", {}, "Reconstruction"),
  );
  const element = h("div", { class: "stage-row" }, canvas, reconstruction);

  let scheduled = false;
  /** Draws with the next frame of the display. */
  const schedule = () => {
    if (scheduled) return;
    scheduled = true;
    requestAnimationFrame(() => {
      scheduled = false;
      void draw();
    });
  };

  const keypointsOf = (/** @type {number} */ frame) => {
    if (keypoints.frame !== frame) keypoints = { frame, points: session.score.keypointsAt(frame) };
    return keypoints.points;
  };

  let ticket = 0;
  const draw = async () => {
    const { frame, object } = session.score.selection;
    const mine = ++ticket;
    const source = session.score.picture(frame);
    let image = source ? cache.peek(source) : null;
    if (source && image === undefined) {
      image = await cache.load(source);
      // Another frame was asked for meanwhile, or other files came.
      if (mine !== ticket) return;
    }
    if (!session.score.scoring) return;
    const size = image ?? sizeOfPlate(session);
    canvas.style.aspectRatio = `${size.width} / ${size.height}`;
    canvas.style.maxWidth = `calc(75vh * ${size.width / size.height})`;
    const scale = window.devicePixelRatio;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) =>
      Math.round(side * scale),
    );
    if (width === 0 || height === 0) return;
    if (canvas.width !== width || canvas.height !== height)
      Object.assign(canvas, { width, height });
    const context = canvas.getContext("2d");
    if (!context) return;
    const missing = source
      ? `${baseName(source.path)} cannot be shown by this browser`
      : "no image of this frame";
    const start = session.score.sequenceOf(frame)?.start ?? frame;
    const heat = look.layers.has("heat") && image ? inside.heat(session, frame) : null;
    paint(context, scale, {
      image: image ?? null,
      caption: image || !session.score.hasPictures ? "" : missing,
      view,
      series: session.score.series(object),
      start: Math.max(start, frame - look.trail),
      frame,
      layers: look.layers,
      keypoints: keypointsOf(frame),
      keypoint: session.score.keypointOf(object),
      hovered,
      heat,
    });
    canvas.dataset.picture = image ? (source?.path ?? "") : "none";
    canvas.dataset.frame = String(frame);
    canvas.dataset.heat = String(heat !== null);
    drawReconstruction(frame);
    canvas.setAttribute("aria-label", describe(session));
  };

  /** @param {number} frame */
  const drawReconstruction = (frame) => {
    reconstruction.hidden = !look.layers.has("image") || !Inside.hasImage(session);
    if (reconstruction.hidden) return;
    const image = inside.image(session, frame);
    decoded.dataset.frame = image ? String(frame) : "";
    // While the next one is made the last one stays.
    if (!image) return;
    Object.assign(decoded, { width: image.width, height: image.height });
    decoded.style.aspectRatio = `${image.width} / ${image.height}`;
    decoded.getContext("2d")?.putImageData(image, 0, 0);
    decoded.setAttribute(
      "aria-label",
      `What the decoder makes of the keypoints of frame ${session.score.frameNumbers[frame]}`,
    );
  };

  // What the pointer is over

  /**
   * @param {PointerEvent} event
   * @returns {number | null} the nearest keypoint within reach
   */
  const under = ({ clientX, clientY }) => {
    if (!session.score.scoring || !look.layers.has("keypoints")) return null;
    const bounds = canvas.getBoundingClientRect();
    const place = placing(
      /** @type {HTMLCanvasElement} */ ({ width: bounds.width, height: bounds.height }),
      view,
    );
    const points = keypointsOf(session.score.selection.frame);
    let nearest = null;
    let distance = REACH;
    for (let n = 0; 2 * n < points.length; n++) {
      const { x, y } = place(points[2 * n], points[2 * n + 1]);
      const from = Math.hypot(x + bounds.left - clientX, y + bounds.top - clientY);
      if (from < distance) [nearest, distance] = [n, from];
    }
    return nearest;
  };
  const hover = (/** @type {number | null} */ next) => {
    if (next === hovered) return;
    hovered = next;
    canvas.dataset.hovered = next === null ? "" : String(next);
    schedule();
  };
  canvas.addEventListener("pointermove", (event) => hover(under(event)));
  canvas.addEventListener("pointerleave", () => hover(null));

  const gesture = gestures(canvas, {
    onView: (next) => {
      view = next;
      schedule();
    },
    onClick: (event) => {
      const keypoint = under(event);
      if (keypoint !== null) session.score.choose(session.score.selection.object, keypoint);
    },
  });

  /** Forgets the images: other files came. */
  const reset = () => {
    ticket++;
    hovered = null;
    keypoints = { frame: -1, points: new Float64Array() };
    cache.clear();
    inside.clear();
  };
  /**
   * Decodes the image of a frame that is shown soon.
   * @param {number} frame
   */
  const prepare = (frame) => {
    const source = session.score.picture(frame);
    if (source) void cache.load(source);
  };

  new ResizeObserver(schedule).observe(canvas);
  window.addEventListener("resize", schedule);
  return { element, draw: schedule, reset, prepare, gesture };
}

/** @param {Session} session */
function sizeOfPlate(session) {
  const [width, height] = session.score.imageSize ?? [1, 1];
  return { width, height };
}

/** @param {Session} session */
function describe(session) {
  const { object, frame } = session.score.selection;
  const series = session.score.series(object);
  const where =
    `Frame ${session.score.frameNumbers[frame]} of sequence ` +
    `${session.score.sequenceOf(frame)?.name}`;
  if (!series) return where;
  const point = (/** @type {Float64Array} */ points) => {
    const [x, y] = points.subarray(2 * frame, 2 * frame + 2);
    return Number.isNaN(x) ? "not visible" : `at x ${fixed(x)}, y ${fixed(y)}`;
  };
  return (
    `${where}: ${session.score.objects[object]} ${point(series.truth)}, keypoint ` +
    `${session.score.keypointOf(object)} ${point(series.keypoint)}, transformed ` +
    `${point(series.transformed)}`
  );
}
