// @ts-check
/** The frame that is marked: its image with the marks, and where it is clicked. */

import { ImageCache } from "../files/image-cache.js";
import { h } from "../ui/dom.js";
import { baseName } from "../ui/format.js";
import { objectColor } from "../ui/palette.js";
import { fit } from "../viewer/fit.js";
import { Gestures } from "../viewer/gestures.js";
import { paint } from "../viewer/scene.js";
import { WHOLE, pointAt } from "../viewer/view.js";

/**
 * @typedef {import("../files/sources.js").Source} Source
 * @typedef {import("./marks.js").Mark} Mark
 *
 * @typedef {{ source: Source, marks: readonly (Mark | null)[], object: number, label: string }}
 * Shown `object`: the one that is marked with the next click
 */

const MIDDLE = { x: 0.5, y: 0.5 };
const UNKNOWN = new Float64Array([NaN, NaN]);
/** Half of the cross in the middle, in CSS pixels. */
const CROSS = 8;

export class MarkingStage {
  canvas = h("canvas", { id: "marking-stage", class: "stage", role: "img", tabIndex: 0 });
  gesture;

  #cache = new ImageCache();
  #view = WHOLE;
  /** @type {Shown | null} */
  #shown = null;
  /** The frame whose image is on display. @type {Source | null} */
  #drawn = null;
  /** Tells a drawing that another one began while it waited. */
  #ticket = 0;

  /** @param {(point: { x: number, y: number }) => void} onPoint a click, in ndc */
  constructor(onPoint) {
    this.gesture = new Gestures(this.canvas, {
      onView: (next) => {
        this.#view = next;
        void this.#draw();
      },
      onClick: (event) => onPoint(pointAt(this.#view, this.gesture.share(event))),
    });
    new ResizeObserver(() => void this.#draw()).observe(this.canvas);
  }

  /** The point in the middle of what is shown, in ndc. */
  get middle() {
    return pointAt(this.#view, MIDDLE);
  }

  /** Whether the image on display is that of the frame to show, which may still be read. */
  get isCurrent() {
    return this.#shown !== null && this.#drawn === this.#shown.source;
  }

  /** @param {Shown} shown */
  show(shown) {
    this.#shown = shown;
    void this.#draw();
  }

  /**
   * Decodes an image that is shown soon.
   * @param {Source} source
   */
  prepare(source) {
    void this.#cache.load(source);
  }

  /** Forgets the images. */
  clear() {
    this.#ticket++;
    this.#shown = null;
    this.#drawn = null;
    delete this.canvas.dataset.picture;
    this.#cache.clear();
  }

  async #draw() {
    const mine = ++this.#ticket;
    const shown = this.#shown;
    if (!shown) return;
    const image = this.#cache.peek(shown.source) ?? (await this.#cache.load(shown.source));
    if (mine !== this.#ticket) return;
    const context = fit(this.canvas, image ?? { width: 1, height: 1 });
    if (!context) return;
    const scale = window.devicePixelRatio;
    paint(context, scale, {
      image,
      caption: image ? "" : `${baseName(shown.source.path)} cannot be shown by this browser`,
      view: this.#view,
      tracks: tracksOf(shown),
      ...{ start: 0, frame: 0, layers: new Set(["truth"]) },
      ...{ keypoints: new Float64Array(), hovered: null, heat: null },
    });
    if (this.#view.zoom > 1) paintMiddle(context, scale);
    this.#drawn = shown.source;
    this.canvas.dataset.picture = shown.source.path;
    this.canvas.setAttribute("aria-label", shown.label);
  }
}

/**
 * The marks as what the viewer draws, the object at hand over the others.
 * @param {Shown} shown
 * @returns {import("../viewer/scene.js").Track[]}
 */
function tracksOf({ marks, object }) {
  const tracks = marks.flatMap((mark, i) => {
    if (mark === null || mark === "hidden") return [];
    const truth = Float64Array.of(mark.x, mark.y);
    const series = { truth, keypoint: UNKNOWN, transformed: UNKNOWN, distances: UNKNOWN };
    return [{ series, keypoint: null, color: objectColor(i), isSelected: i === object }];
  });
  return tracks.sort((a, b) => Number(a.isSelected) - Number(b.isSelected));
}

/**
 * A cross in the middle, which a key marks.
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 */
function paintMiddle(context, scale) {
  const [x, y] = [context.canvas.width / 2, context.canvas.height / 2];
  const arm = CROSS * scale;
  context.beginPath();
  context.moveTo(x - arm, y);
  context.lineTo(x + arm, y);
  context.moveTo(x, y - arm);
  context.lineTo(x, y + arm);
  for (const [style, width] of /** @type {const} */ ([
    ["rgb(8 10 12 / 75%)", 3],
    ["#ffffff", 1],
  ])) {
    context.strokeStyle = style;
    context.lineWidth = width * scale;
    context.stroke();
  }
}
