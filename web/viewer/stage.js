// @ts-check
/** The frame on display: its image, its points, what the pointer is over. */

import { h } from "../ui/dom.js";
import { baseName, fixed } from "../ui/format.js";
import { ImageCache } from "../files/image-cache.js";
import { fit } from "./fit.js";
import { Gestures } from "./gestures.js";
import { Inside } from "./inside.js";
import { paint, placing } from "./scene.js";
import { tracksOf } from "./tracks.js";
import { WHOLE } from "./view.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../files/sources.js").Source} Source
 * @typedef {import("./scene.js").Layer} Layer
 * @typedef {{ layers: Set<Layer>, trail: number }} Look `trail`: how many frames back
 */

/** A keypoint is under the pointer from this far on, in CSS pixels. */
const REACH = 12;

export class Stage {
  element;
  gesture;

  #session;
  #look;
  #cache = new ImageCache();
  #canvas = h("canvas", { id: "stage", class: "stage", role: "img", tabIndex: 0 });
  #decoded = h("canvas", { id: "reconstruction", class: "stage", role: "img" });
  #reconstruction = h(
    "figure",
    { class: "reconstruction", hidden: true },
    this.#decoded,
    h("figcaption", {}, "Reconstruction"),
  );
  #inside;
  #view = WHOLE;
  /** The keypoint under the pointer. @type {number | null} */
  #hovered = null;
  /** All keypoints of a frame. @type {{ frame: number, points: Float64Array }} */
  #keypoints = { frame: -1, points: new Float64Array() };
  #isScheduled = false;
  /** Tells a drawing that another one began while it waited. */
  #ticket = 0;

  /**
   * @param {Session} session
   * @param {Look} look
   * @param {(message: string) => void} onProblem why there is no heat map or reconstruction; empty
   * when there is one
   */
  constructor(session, look, onProblem) {
    this.#session = session;
    this.#look = look;
    this.#inside = new Inside((problem) => {
      onProblem(problem);
      this.draw();
    });
    this.element = h("div", { class: "stage-row" }, this.#canvas, this.#reconstruction);
    this.#canvas.addEventListener("pointermove", (event) => this.#hover(this.#under(event)));
    this.#canvas.addEventListener("pointerleave", () => this.#hover(null));
    this.gesture = new Gestures(this.#canvas, {
      onView: (next) => {
        this.#view = next;
        this.draw();
      },
      onClick: (event) => {
        const keypoint = this.#under(event);
        if (keypoint !== null) session.score.choose(session.score.selection.object, keypoint);
      },
    });
    new ResizeObserver(() => this.draw()).observe(this.#canvas);
    window.addEventListener("resize", () => this.draw());
  }

  /** Draws with the next frame of the display. */
  draw() {
    if (this.#isScheduled) return;
    this.#isScheduled = true;
    requestAnimationFrame(() => {
      this.#isScheduled = false;
      void this.#draw();
    });
  }

  /** Forgets the points: there are others. */
  renew() {
    this.#keypoints = { frame: -1, points: new Float64Array() };
    this.draw();
  }

  /** Forgets the images: other files came. */
  reset() {
    this.#ticket++;
    this.#hovered = null;
    this.#keypoints = { frame: -1, points: new Float64Array() };
    this.#cache.clear();
    this.#inside.clear();
  }

  /**
   * Decodes the image of a frame that is shown soon.
   * @param {number} frame
   */
  prepare(frame) {
    const source = this.#session.score.picture(frame);
    if (source) void this.#cache.load(source);
  }

  async #draw() {
    const { score } = this.#session;
    const { frame } = score.selection;
    const mine = ++this.#ticket;
    const source = score.picture(frame);
    let image = source ? this.#cache.peek(source) : null;
    if (source && image === undefined) {
      image = await this.#cache.load(source);
      // Another frame was asked for meanwhile, or other files came.
      if (mine !== this.#ticket) return;
    }
    if (!score.shown) return;
    const context = fit(this.#canvas, image ?? sizeOfPlate(this.#session));
    if (!context) return;
    const heat = this.#paint(context, frame, image ?? null, source);
    const picture = image ? (source?.path ?? "") : "none";
    Object.assign(this.#canvas.dataset, { picture, frame: String(frame), heat: String(heat) });
    this.#drawReconstruction(frame);
    this.#canvas.setAttribute("aria-label", describe(this.#session));
  }

  /**
   * Whether there is a heat map in it.
   * @param {CanvasRenderingContext2D} context
   * @param {number} frame
   * @param {ImageBitmap | null} image
   * @param {Source | null} source
   */
  #paint(context, frame, image, source) {
    const { score } = this.#session;
    const { layers, trail } = this.#look;
    const missing = source
      ? `${baseName(source.path)} cannot be shown by this browser`
      : "no image of this frame";
    const start = score.sequenceOf(frame)?.start ?? frame;
    const heat = layers.has("heat") && image ? this.#inside.heat(this.#session, frame) : null;
    paint(context, window.devicePixelRatio, {
      image,
      caption: image || !score.hasPictures ? "" : missing,
      view: this.#view,
      tracks: tracksOf(this.#session),
      start: Math.max(start, frame - trail),
      frame,
      layers,
      keypoints: this.#keypointsOf(frame),
      hovered: this.#hovered,
      heat,
    });
    return heat !== null;
  }

  /** @param {number} frame */
  #keypointsOf(frame) {
    if (this.#keypoints.frame !== frame) {
      this.#keypoints = { frame, points: this.#session.score.keypointsAt(frame) };
    }
    return this.#keypoints.points;
  }

  /** @param {number} frame */
  #drawReconstruction(frame) {
    const isHidden = !this.#look.layers.has("image") || !Inside.hasImage(this.#session);
    this.#reconstruction.hidden = isHidden;
    if (isHidden) return;
    const decoded = this.#decoded;
    const image = this.#inside.image(this.#session, frame);
    decoded.dataset.frame = image ? String(frame) : "";
    // While the next one is made the last one stays.
    if (!image) return;
    Object.assign(decoded, { width: image.width, height: image.height });
    decoded.style.aspectRatio = `${image.width} / ${image.height}`;
    decoded.getContext("2d")?.putImageData(image, 0, 0);
    decoded.setAttribute(
      "aria-label",
      `What the decoder makes of the keypoints of frame ${this.#session.score.frameNumbers[frame]}`,
    );
  }

  /**
   * The nearest keypoint within reach of the pointer.
   * @param {PointerEvent} event
   * @returns {number | null}
   */
  #under({ clientX, clientY }) {
    const { score } = this.#session;
    if (!score.scoring || !this.#look.layers.has("keypoints")) return null;
    const { left, top, width, height } = this.#canvas.getBoundingClientRect();
    const place = placing(/** @type {HTMLCanvasElement} */ ({ width, height }), this.#view);
    const points = this.#keypointsOf(score.selection.frame);
    let nearest = null;
    let distance = REACH;
    for (let n = 0; 2 * n < points.length; n++) {
      const { x, y } = place(points[2 * n], points[2 * n + 1]);
      const from = Math.hypot(x + left - clientX, y + top - clientY);
      if (from < distance) [nearest, distance] = [n, from];
    }
    return nearest;
  }

  /** @param {number | null} next */
  #hover(next) {
    if (next === this.#hovered) return;
    this.#hovered = next;
    this.#canvas.dataset.hovered = next === null ? "" : String(next);
    this.draw();
  }
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
  if (!series || session.score.keypointOf(object) === null) return where;
  const [ofKeypoint, ofObject] = session.score.axes;
  const point = (/** @type {Float64Array} */ points, axes = ofObject) => {
    const at = Array.from(points.subarray(axes * frame, axes * (frame + 1)));
    if (at.some(Number.isNaN)) return "not visible";
    return `at ${at.map((value, i) => `${"xyz"[i]} ${fixed(value)}`).join(", ")}`;
  };
  return (
    `${where}: ${session.score.objects[object]} ${point(series.truth)}, keypoint ` +
    `${session.score.keypointOf(object)} ${point(series.keypoint, ofKeypoint)}, transformed ` +
    `${point(series.transformed)}`
  );
}
