// @ts-check
/** Draws a frame with its points and their trails. Every mark has a form of its own and an outline. */

/**
 * @typedef {object} Scene
 * @property {ImageBitmap | null} image
 * @property {string} caption said where the image is missing
 * @property {import("./pkg/index.js").Series | null} series in ndc, over all joined frames
 * @property {number} start first frame of the sequence
 * @property {number} frame the one on display
 */

/** @typedef {"truth" | "keypoint" | "transformed"} Mark */

/** Marks lie on images, so they are the same under light and dark schemes. @type {Record<Mark, string>} */
const COLORS = { truth: "#ffffff", keypoint: "#ff4b45", transformed: "#45a1ff" };
const OUTLINE = "rgb(8 10 12 / 75%)";
const PLATE = "#22272d";
const PLATE_LINES = "#3a4149";

/** In CSS pixels. */
const SIZE = { mark: 7, trail: 1.75, outline: 1.5, edge: 9 };

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale canvas pixels a CSS pixel
 * @param {Scene} scene
 */
export function paint(context, scale, { image, caption, series, start, frame }) {
  const { width, height } = context.canvas;
  context.setTransform(1, 0, 0, 1, 0, 0);
  if (image) {
    context.imageSmoothingQuality = "high";
    context.drawImage(image, 0, 0, width, height);
  } else {
    paintPlate(context, scale, caption);
  }
  if (!series) return;
  context.lineCap = "round";
  context.lineJoin = "round";
  const place = (/** @type {Float64Array} */ points, /** @type {number} */ t) => ({
    x: ((points[2 * t] + 1) / 2) * width,
    y: ((points[2 * t + 1] + 1) / 2) * height,
  });
  /** @type {[Mark, Float64Array][]} */
  const layers = [
    ["keypoint", series.keypoint],
    ["truth", series.truth],
    ["transformed", series.transformed],
  ];
  for (const [mark, points] of layers) {
    const trail = [];
    for (let t = start; t <= frame; t++) trail.push(place(points, t));
    paintTrail(context, scale, trail, COLORS[mark]);
  }
  for (const [mark, points] of layers) {
    const at = place(points, frame);
    if (Number.isNaN(at.x) || Number.isNaN(at.y)) continue;
    const inside = at.x >= 0 && at.x <= width && at.y >= 0 && at.y <= height;
    if (inside) paintMark(context, scale, at, mark);
    else paintEdge(context, scale, at, COLORS[mark]);
  }
}

/**
 * What stands in for an image: the area of the image with its axes.
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {string} caption
 */
function paintPlate(context, scale, caption) {
  const { width, height } = context.canvas;
  context.fillStyle = PLATE;
  context.fillRect(0, 0, width, height);
  context.strokeStyle = PLATE_LINES;
  context.lineWidth = scale;
  context.beginPath();
  for (const share of [0.25, 0.5, 0.75]) {
    context.moveTo(share * width, 0);
    context.lineTo(share * width, height);
    context.moveTo(0, share * height);
    context.lineTo(width, share * height);
  }
  context.stroke();
  if (!caption) return;
  context.fillStyle = "#aab4bf";
  context.font = `${13 * scale}px system-ui, sans-serif`;
  context.textAlign = "center";
  context.fillText(caption, width / 2, height - 14 * scale, width - 24 * scale);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {{ x: number, y: number }[]} trail NaN leaves a gap
 * @param {string} color
 */
function paintTrail(context, scale, trail, color) {
  context.beginPath();
  let down = false;
  for (const { x, y } of trail) {
    const visible = !Number.isNaN(x) && !Number.isNaN(y);
    if (visible && down) context.lineTo(x, y);
    else if (visible) context.moveTo(x, y);
    down = visible;
  }
  stroke(context, scale, color, SIZE.trail);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {{ x: number, y: number }} at
 * @param {Mark} mark
 */
function paintMark(context, scale, { x, y }, mark) {
  const r = SIZE.mark * scale;
  context.beginPath();
  if (mark === "truth") context.arc(x, y, r, 0, 2 * Math.PI);
  else if (mark === "keypoint") {
    const d = 0.75 * r;
    context.moveTo(x - d, y - d);
    context.lineTo(x + d, y + d);
    context.moveTo(x + d, y - d);
    context.lineTo(x - d, y + d);
  } else {
    const d = 0.8 * r;
    context.moveTo(x, y - d);
    context.lineTo(x + d, y);
    context.lineTo(x, y + d);
    context.lineTo(x - d, y);
    context.closePath();
  }
  stroke(context, scale, COLORS[mark], 2.25);
  if (mark === "transformed") {
    context.fillStyle = COLORS[mark];
    context.fill();
  }
}

/**
 * An arrow at the edge towards a point outside the image.
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {{ x: number, y: number }} at
 * @param {string} color
 */
function paintEdge(context, scale, { x, y }, color) {
  const { width, height } = context.canvas;
  const margin = SIZE.edge * scale;
  const tip = {
    x: Math.min(Math.max(x, margin / 2), width - margin / 2),
    y: Math.min(Math.max(y, margin / 2), height - margin / 2),
  };
  context.save();
  context.translate(tip.x, tip.y);
  context.rotate(Math.atan2(y - tip.y, x - tip.x));
  context.beginPath();
  context.moveTo(-margin, -margin * 0.7);
  context.lineTo(0, 0);
  context.lineTo(-margin, margin * 0.7);
  stroke(context, scale, color, 2.5);
  context.restore();
}

/**
 * Strokes the path with an outline under it.
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {string} color
 * @param {number} width in CSS pixels
 */
function stroke(context, scale, color, width) {
  context.strokeStyle = OUTLINE;
  context.lineWidth = (width + 2 * SIZE.outline) * scale;
  context.stroke();
  context.strokeStyle = color;
  context.lineWidth = width * scale;
  context.stroke();
}
