// @ts-check
/**
 * Trajectories of the sequence on display over its last frame, a panel an object, as in the paper's
 * figure: ground truth white, keypoint red, keypoint under the fitted map blue.
 */

import { decodeImage } from "../files/image-cache.js";
import { fill, h, icon } from "../ui/dom.js";
import { save } from "../ui/download.js";
import { onResized } from "../ui/resized.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {[number, number][]} Line in shares of the image; NaN leaves a gap
 * @typedef {{ title: string, lines: { color: string, width: number, points: Line }[] }} Panel
 */

/** Objects that get a panel. */
const MOST = 12;
/** Width of a panel on the page and in a file, in pixels of the figure. */
const WIDTH = 240;
const CAPTION = 22;
const GAP = 8;
/** Pixels of a PNG for one of the figure. */
const SCALE = 3;
const PLATE = "#22272d";
const OUTLINE = "#0b0d0f";
const COLORS = { truth: "#ffffff", keypoint: "#ff4b45", transformed: "#45a1ff" };

/** @param {Session} session */
export function trajectoriesView(session) {
  const { score } = session;
  const grid = h("ul", { class: "trajectories" });
  const note = h("p", { class: "hint-line" });
  /** The image under the lines. @type {ImageBitmap | null} */
  let image = null;
  let shown = "";

  const update = async () => {
    const range = score.sequenceOf(score.selection.frame);
    const keypoints = score.objects.map((_, object) => score.keypointOf(object));
    const next = JSON.stringify([range, keypoints, score.options.transform, score.options.rank]);
    if (!score.scoring || !range || next === shown) return;
    if (element.checkVisibility?.() === false) return;
    shown = next;
    const source = score.picture(range.start + range.length - 1);
    const decoded = source ? await decodeImage(source).catch(() => null) : null;
    if (next !== shown) {
      decoded?.close();
      return;
    }
    image?.close();
    image = decoded;
    const panels = panelsOf(session);
    fill(grid, ...panels.map((panel) => panelView(panel, image)));
    element.dataset.sequence = range.name;
    note.textContent =
      `${range.name}: ground truth white, keypoint red, keypoint under the fitted map blue` +
      (image ? ", over the last frame." : ".");
  };
  const saved = (/** @type {"svg" | "png"} */ format) =>
    h(
      "button",
      {
        type: "button",
        class: "link",
        id: `save-trajectories-${format}`,
        onclick: () => void saveFigure(panelsOf(session), image, format),
      },
      icon("icon-download"),
      format.toUpperCase(),
      h("span", { class: "visually-hidden" }, " of the trajectories"),
    );
  const links = h("div", { class: "figure-links" }, saved("svg"), saved("png"));
  const element = h(
    "section",
    { class: "panel", id: "trajectories", "aria-labelledby": "trajectories-title" },
    h("h3", { id: "trajectories-title" }, "Trajectories over the frames"),
    note,
    grid,
    links,
  );
  onResized(element, () => void update());
  return { element, update: () => void update() };
}

/**
 * @param {Session} session
 * @returns {Panel[]}
 */
function panelsOf({ score }) {
  const range = score.sequenceOf(score.selection.frame);
  if (!range) return [];
  return score.objects.slice(0, MOST).flatMap((name, object) => {
    const series = score.series(object);
    if (!series) return [];
    const line = (/** @type {Float64Array} */ points) =>
      Array.from({ length: range.length }, (_, i) => {
        const t = range.start + i;
        return /** @type {[number, number]} */ ([
          (points[2 * t] + 1) / 2,
          (points[2 * t + 1] + 1) / 2,
        ]);
      });
    const lines = /** @type {const} */ (["keypoint", "truth", "transformed"]).map((mark) => ({
      color: COLORS[mark],
      width: 2,
      points: line(series[mark]),
    }));
    return [{ title: `${name}, keypoint ${score.keypointOf(object)}`, lines }];
  });
}

/**
 * @param {Panel} panel
 * @param {ImageBitmap | null} image
 */
function panelView(panel, image) {
  const canvas = h("canvas", { class: "trajectory", role: "img", "aria-label": panel.title });
  const height = heightOf(image);
  Object.assign(canvas, { width: SCALE * WIDTH, height: SCALE * height });
  const context = canvas.getContext("2d");
  if (context) {
    context.scale(SCALE, SCALE);
    drawPanel(context, panel, image);
  }
  return h("li", {}, canvas, h("p", {}, panel.title));
}

/** @param {ImageBitmap | null} image */
function heightOf(image) {
  return image ? (WIDTH * image.height) / image.width : WIDTH;
}

/**
 * @param {CanvasRenderingContext2D} context at the corner of the panel
 * @param {Panel} panel
 * @param {ImageBitmap | null} image
 */
function drawPanel(context, { lines }, image) {
  const height = heightOf(image);
  context.fillStyle = PLATE;
  context.fillRect(0, 0, WIDTH, height);
  if (image) context.drawImage(image, 0, 0, WIDTH, height);
  context.lineJoin = "round";
  context.lineCap = "round";
  for (const { color, width, points } of lines) {
    context.beginPath();
    let isDown = false;
    for (const [x, y] of points) {
      const isVisible = !Number.isNaN(x) && !Number.isNaN(y);
      if (isVisible && isDown) context.lineTo(x * WIDTH, y * height);
      else if (isVisible) context.moveTo(x * WIDTH, y * height);
      isDown = isVisible;
    }
    for (const [style, more] of /** @type {[string, number][]} */ ([
      [OUTLINE, 2],
      [color, 0],
    ])) {
      context.strokeStyle = style;
      context.lineWidth = width + more;
      context.stroke();
    }
  }
}

/**
 * The panels side by side.
 * @param {Panel[]} panels
 * @param {ImageBitmap | null} image
 * @param {"svg" | "png"} format
 */
async function saveFigure(panels, image, format) {
  const width = panels.length * (WIDTH + GAP) - GAP;
  const height = heightOf(image) + CAPTION;
  if (format === "svg") {
    save("trajectories.svg", "image/svg+xml", toSvg(panels, image, width, height));
    return;
  }
  const canvas = h("canvas", { width: SCALE * width, height: Math.round(SCALE * height) });
  const context = canvas.getContext("2d");
  if (!context) return;
  context.scale(SCALE, SCALE);
  context.fillStyle = "#ffffff";
  context.fillRect(0, 0, width, height);
  for (const [i, panel] of panels.entries()) {
    context.save();
    context.translate(i * (WIDTH + GAP), 0);
    context.beginPath();
    context.rect(0, 0, WIDTH, heightOf(image));
    context.clip();
    drawPanel(context, panel, image);
    context.restore();
    context.fillStyle = "#15191e";
    context.font = "13px system-ui, sans-serif";
    context.fillText(panel.title, i * (WIDTH + GAP), height - 6, WIDTH);
  }
  /** @type {Blob | null} */
  const blob = await new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
  if (blob) save("trajectories.png", "image/png", blob);
}

/**
 * @param {Panel[]} panels
 * @param {ImageBitmap | null} image
 * @param {number} width
 * @param {number} height
 */
function toSvg(panels, image, width, height) {
  const inner = heightOf(image);
  const href = image ? dataUrl(image) : "";
  const parts = panels.map(({ title, lines }, i) => {
    const back = href
      ? `<image href="${href}" width="${WIDTH}" height="${inner}" preserveAspectRatio="none"/>`
      : "";
    const paths = lines.flatMap(({ color, width, points }) => {
      const d = pathOf(points, inner);
      const stroke = (/** @type {string} */ style, /** @type {number} */ w) =>
        `<path d="${d}" fill="none" stroke="${style}" stroke-width="${w}" ` +
        `stroke-linejoin="round" stroke-linecap="round"/>`;
      return [stroke(OUTLINE, width + 2), stroke(color, width)];
    });
    return (
      `<svg x="${i * (WIDTH + GAP)}" width="${WIDTH}" height="${inner}">` +
      `<rect width="${WIDTH}" height="${inner}" fill="${PLATE}"/>${back}${paths.join("")}</svg>` +
      `<text x="${i * (WIDTH + GAP)}" y="${height - 6}" font-family="sans-serif" ` +
      `font-size="13" fill="#15191e">${escaped(title)}</text>`
    );
  });
  return (
    `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" ` +
    `viewBox="0 0 ${width} ${height}"><rect width="100%" height="100%" fill="#ffffff"/>` +
    `${parts.join("")}</svg>\n`
  );
}

/**
 * @param {Line} points
 * @param {number} height
 */
function pathOf(points, height) {
  let d = "";
  let isDown = false;
  for (const [x, y] of points) {
    const isVisible = !Number.isNaN(x) && !Number.isNaN(y);
    if (isVisible) d += `${isDown ? "L" : "M"}${(x * WIDTH).toFixed(2)} ${(y * height).toFixed(2)}`;
    isDown = isVisible;
  }
  return d;
}

/** @param {ImageBitmap} image */
function dataUrl(image) {
  const canvas = h("canvas", { width: image.width, height: image.height });
  canvas.getContext("2d")?.drawImage(image, 0, 0);
  return canvas.toDataURL("image/png");
}

/** @param {string} text */
function escaped(text) {
  const names = { "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" };
  return text.replace(/[&<>"]/g, (character) => Reflect.get(names, character));
}
