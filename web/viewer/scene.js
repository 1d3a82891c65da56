// @ts-check
/**
 * Draws a frame with its points and their trails. Every mark has a form of its own and an outline.
 */

/**
 * @typedef {object} Scene
 * @property {ImageBitmap | null} image
 * @property {string} caption said where the image is missing
 * @property {import("./view.js").View} view
 * @property {Track[]} tracks the last one lies over the others
 * @property {number} start first frame of the trails
 * @property {number} frame the one on display
 * @property {Set<Layer>} layers those to draw
 * @property {Float64Array} keypoints all of the frame in ndc, N x 2
 * @property {number | null} hovered the one under the pointer
 * @property {Heat | null} heat
 *
 * An object with its keypoint: series in ndc, over all joined frames.
 * @typedef {{ series: import("../pkg/index.js").Series, keypoint: number | null, color: string,
 * isSelected: boolean }} Track
 *
 * A heat map with the area of the image it covers, as shares of the image.
 * @typedef {{ image: CanvasImageSource, left: number, top: number, width: number, height: number }}
 * Heat
 */

/** @typedef {"truth" | "keypoint" | "transformed"} Mark */
/** @typedef {Mark | "keypoints" | "trails" | "heat" | "image"} Layer */
/** @typedef {{ x: number, y: number }} Point */

/** In the order in which they are drawn. @type {Mark[]} */
const MARKS = ["keypoint", "truth", "transformed"];
/** The trail of a mark: dashes and gaps in CSS pixels, and its share of opacity. */
const TRAILS = {
  truth: { dashes: [], alpha: 1 },
  keypoint: { dashes: [1, 5], alpha: 0.75 },
  transformed: { dashes: [6, 4], alpha: 1 },
};
const BRIGHT = "#ffffff";
const DIM = "rgb(236 240 244 / 80%)";
const OUTLINE = "rgb(8 10 12 / 75%)";
const PLATE = "#22272d";
const PLATE_LINES = "#3a4149";

/** In CSS pixels. */
const SIZE = { mark: 7, line: 2, dot: 2.5, trail: 1.75, outline: 1.5, edge: 9, label: 12 };
/** What belongs to the selected object is larger. */
const SELECTED = 1.3;
/** From this many canvas pixels a pixel of the image on, its pixels are shown as they are. */
const PIXELATED = 6;

/**
 * From ndc to canvas pixels.
 * @param {CanvasRenderingContext2D["canvas"]} canvas
 * @param {import("./view.js").View} view
 * @returns {(x: number, y: number) => Point}
 */
export function placing({ width, height }, view) {
  return (x, y) => ({
    x: (((x + 1) / 2 - view.x) * view.zoom + 0.5) * width,
    y: (((y + 1) / 2 - view.y) * view.zoom + 0.5) * height,
  });
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale canvas pixels a CSS pixel
 * @param {Scene} scene
 */
export function paint(context, scale, scene) {
  const place = placing(context.canvas, scene.view);
  context.setTransform(1, 0, 0, 1, 0, 0);
  paintImage(context, scale, scene, place);
  context.lineCap = "round";
  context.lineJoin = "round";
  if (scene.layers.has("keypoints")) paintKeypoints(context, scale, scene, place);
  const marks = MARKS.filter((mark) => scene.layers.has(mark));
  const at = (/** @type {Float64Array} */ points, /** @type {number} */ t) =>
    place(points[2 * t], points[2 * t + 1]);
  if (scene.layers.has("trails")) {
    for (const track of scene.tracks) paintTrails(context, scale, scene, track, marks, at);
  }
  for (const { series, color, isSelected } of scene.tracks) {
    const size = isSelected ? SELECTED : 1;
    for (const mark of marks) {
      const point = at(series[mark], scene.frame);
      if (Number.isNaN(point.x) || Number.isNaN(point.y)) continue;
      if (isInside(context.canvas, point)) paintMark(context, scale * size, point, mark, color);
      else paintEdge(context, scale, point, color);
    }
  }
  if (scene.hovered !== null) paintNumber(context, scale, scene, place);
}

/**
 * @param {{ width: number, height: number }} canvas
 * @param {Point} point
 */
function isInside({ width, height }, { x, y }) {
  return x >= 0 && x <= width && y >= 0 && y <= height;
}

/**
 * The trails of an object and its keypoint.
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {Scene} scene
 * @param {Track} track
 * @param {Mark[]} marks
 * @param {(points: Float64Array, t: number) => Point} at
 */
function paintTrails(context, scale, { start, frame }, { series, color }, marks, at) {
  for (const mark of marks) {
    const trail = [];
    for (let t = start; t <= frame; t++) trail.push(at(series[mark], t));
    const { dashes, alpha } = TRAILS[mark];
    context.globalAlpha = alpha;
    context.setLineDash(dashes.map((length) => length * scale));
    paintTrail(context, scale, trail, color);
  }
  context.globalAlpha = 1;
  context.setLineDash([]);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {Scene} scene
 * @param {ReturnType<typeof placing>} place
 */
function paintImage(context, scale, { image, caption, view, heat, layers }, place) {
  const { width, height } = context.canvas;
  const corner = place(-1, -1);
  if (image) {
    context.imageSmoothingEnabled = (width * view.zoom) / image.width < PIXELATED;
    context.imageSmoothingQuality = "high";
    context.drawImage(image, corner.x, corner.y, width * view.zoom, height * view.zoom);
  } else {
    paintPlate(context, scale, caption);
  }
  if (!heat || !layers.has("heat")) return;
  const area = { width: width * view.zoom, height: height * view.zoom };
  context.imageSmoothingEnabled = true;
  context.drawImage(
    heat.image,
    corner.x + heat.left * area.width,
    corner.y + heat.top * area.height,
    heat.width * area.width,
    heat.height * area.height,
  );
}

/**
 * All keypoints of the frame, dim.
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {Scene} scene
 * @param {ReturnType<typeof placing>} place
 */
function paintKeypoints(context, scale, { keypoints, tracks, hovered }, place) {
  const marked = new Set(tracks.map(({ keypoint }) => keypoint));
  for (let n = 0; 2 * n < keypoints.length; n++) {
    if (marked.has(n)) continue;
    const { x, y } = place(keypoints[2 * n], keypoints[2 * n + 1]);
    context.beginPath();
    context.arc(x, y, SIZE.dot * scale * (n === hovered ? 1.6 : 1), 0, 2 * Math.PI);
    context.fillStyle = OUTLINE;
    context.lineWidth = 2 * SIZE.outline * scale;
    context.strokeStyle = OUTLINE;
    context.stroke();
    context.fillStyle = n === hovered ? BRIGHT : DIM;
    context.fill();
  }
}

/**
 * The number of the keypoint under the pointer.
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {Scene} scene
 * @param {ReturnType<typeof placing>} place
 */
function paintNumber(context, scale, { keypoints, hovered }, place) {
  const n = /** @type {number} */ (hovered);
  const { x, y } = place(keypoints[2 * n], keypoints[2 * n + 1]);
  const text = `no. ${n}`;
  context.font = `600 ${SIZE.label * scale}px system-ui, sans-serif`;
  context.textAlign = "left";
  context.textBaseline = "middle";
  const padding = 4 * scale;
  const box = {
    width: context.measureText(text).width + 2 * padding,
    height: (SIZE.label + 8) * scale,
  };
  const gap = 9 * scale;
  const right = x + gap + box.width <= context.canvas.width;
  const left = right ? x + gap : x - gap - box.width;
  const top = Math.min(Math.max(y - box.height / 2, 0), context.canvas.height - box.height);
  context.beginPath();
  context.roundRect(left, top, box.width, box.height, 4 * scale);
  context.fillStyle = "rgb(8 10 12 / 85%)";
  context.fill();
  context.fillStyle = "#ffffff";
  context.fillText(text, left + padding, top + box.height / 2);
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
  context.textBaseline = "alphabetic";
  context.fillText(caption, width / 2, height - 14 * scale, width - 24 * scale);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {Point[]} trail NaN leaves a gap
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
 * @param {Point} at
 * @param {Mark} mark
 * @param {string} color
 */
export function paintMark(context, scale, { x, y }, mark, color) {
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
  stroke(context, scale, color, SIZE.line);
  if (mark === "transformed") {
    context.fillStyle = color;
    context.fill();
  }
}

/**
 * An arrow at the edge towards a point outside of what is shown.
 * @param {CanvasRenderingContext2D} context
 * @param {number} scale
 * @param {Point} at
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
