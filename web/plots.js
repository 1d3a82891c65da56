// @ts-check
/** x(t) and y(t) of an object over a sequence: drawn by plotters onto canvases, saved as SVG. */

import init, { drawLines, linesToSvg } from "./pkg/index.js";
import { h, icon } from "./dom.js";
import { save } from "./download.js";

/**
 * @typedef {import("./session.js").Session} Session
 * @typedef {import("./pkg/index.js").LineFigure} LineFigure
 * @typedef {Record<"truth" | "keypoint" | "transformed" | "foreground" | "background" | "grid", string>} Colors
 */

const AXES = /** @type {const} */ (["x", "y"]);
/** In CSS pixels; the smaller one where a plot is narrow. */
const FONT_SIZE = { usual: 12, narrow: 10 };
const NARROW = 340;
const SVG_SIZE = { width: 720, height: 320, fontSize: 14 };
/** Frame numbers further apart than this many times their count are drawn one after the other. */
const MAX_STRETCH = 20;

/** For print, whatever the scheme of the page. @type {Colors} */
const PRINT = {
  truth: "#1b1f24",
  keypoint: "#d0342c",
  transformed: "#1f6feb",
  foreground: "#1b1f24",
  background: "#ffffff",
  grid: "#e3e7eb",
};

/** @param {Session} session */
export function plots(session) {
  const figures = AXES.map((axis, component) => {
    const canvas = h("canvas", { class: "plot", role: "img", data: { axis } });
    const saveButton = h(
      "button",
      {
        type: "button",
        class: "link",
        id: `save-plot-${axis}`,
        onclick: () => {
          const figure = describe(session, component, PRINT, SVG_SIZE.fontSize);
          if (!figure) return;
          const { name } = /** @type {{ name: string }} */ (session.sequenceOf(session.selection.frame));
          const file = `${objectName(session)}-${axis}-${name}.svg`.replace(/[^\w.-]+/g, "_");
          const svg = linesToSvg({ ...figure, cursor: null }, SVG_SIZE.width, SVG_SIZE.height);
          save(file, "image/svg+xml", svg);
        },
      },
      icon("icon-download"),
      "SVG",
      h("span", { class: "visually-hidden" }, ` of ${axis} over the frames`),
    );
    const caption = h("figcaption", {}, h("span"), saveButton);
    const element = h("figure", { class: "plot-figure" }, caption, canvas);
    return { element, canvas, caption, component };
  });

  let scheduled = false;
  const draw = async () => {
    scheduled = false;
    try {
      // Loaded when there is something to draw.
      if (session.evaluation) await init(["figures"]);
    } catch (error) {
      const reason = error instanceof Error ? error.message : String(error);
      for (const { caption } of figures) {
        caption.hidden = false;
        /** @type {HTMLElement} */ (caption.firstChild).textContent = `No plot: ${reason}. Reload the page to try again.`;
      }
      return;
    }
    const colors = schemeColors();
    for (const { canvas, caption, component } of figures) {
      const title = drawOne(session, canvas, component, colors);
      caption.hidden = title === "";
      /** @type {HTMLElement} */ (caption.firstChild).textContent = title;
    }
  };
  const schedule = () => {
    if (scheduled) return;
    scheduled = true;
    requestAnimationFrame(() => void draw());
  };
  for (const topic of ["scoring", "evaluation", "selection"]) session.addEventListener(topic, schedule);
  // Zooming changes the pixels of a canvas without changing its size in the layout.
  window.addEventListener("resize", schedule);
  const resized = new ResizeObserver(schedule);
  for (const { canvas } of figures) resized.observe(canvas);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", schedule);
  return figures.map(({ element }) => element);
}

/**
 * Draws a plot and returns its title, which the page shows above it as text; empty when there is nothing to plot.
 * @param {Session} session
 * @param {HTMLCanvasElement} canvas
 * @param {number} component
 * @param {Colors} colors
 */
function drawOne(session, canvas, component, colors) {
  const { clientWidth, clientHeight } = canvas;
  if (clientWidth === 0 || clientHeight === 0) return "";
  const scale = window.devicePixelRatio;
  const fontSize = clientWidth < NARROW ? FONT_SIZE.narrow : FONT_SIZE.usual;
  const figure = describe(session, component, colors, Math.round(fontSize * scale));
  const width = Math.round(clientWidth * scale);
  const height = Math.round(clientHeight * scale);
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  if (!figure) {
    canvas.getContext("2d")?.clearRect(0, 0, width, height);
    canvas.setAttribute("aria-label", "No plot: the object is visible in no frame");
    return "";
  }
  drawLines(canvas, { ...figure, title: "" });
  canvas.dataset.points = String(figure.series[0].values.length);
  const labels = figure.series.map(({ label }) => label).join(", ");
  canvas.setAttribute("aria-label", `${figure.title}, over the frames: ${labels}`);
  return figure.title;
}

/**
 * @param {Session} session
 * @param {number} component 0 for x, 1 for y
 * @param {Colors} colors
 * @param {number} fontSize
 * @returns {LineFigure | null}
 */
function describe(session, component, colors, fontSize) {
  const { evaluation, selection } = session;
  const series = session.series(selection.object);
  const sequence = session.sequenceOf(selection.frame);
  if (!evaluation || !series || !sequence) return null;
  const keypoint = session.keypointOf(selection.object);
  const { start, at } = axisOf(session.frameNumbers.subarray(sequence.start, sequence.start + sequence.length));
  const length = at[at.length - 1] + 1;
  const line = (/** @type {string} */ label, /** @type {string} */ color, /** @type {Float64Array} */ points) => {
    const values = new Float64Array(length).fill(NaN);
    at.forEach((position, i) => (values[position] = points[2 * (sequence.start + i) + component]));
    return { label, color, values };
  };
  const axis = AXES[component];
  return {
    title: `${axis} of ${objectName(session)}, sequence ${sequence.name}`,
    xLabel: "frame",
    yLabel: `${axis} (ndc)`,
    start,
    series: [
      line(`keypoint ${keypoint}`, colors.keypoint, series.keypoint),
      line("truth", colors.truth, series.truth),
      line("transformed", colors.transformed, series.transformed),
    ],
    cursor: at[selection.frame - sequence.start],
    foreground: colors.foreground,
    background: colors.background,
    grid: colors.grid,
    fontSize,
  };
}

/**
 * Where each frame of a sequence stands on the axis. Missing frames leave gaps, unless most are missing.
 * @param {Float64Array} numbers
 */
function axisOf(numbers) {
  const start = numbers[0];
  const span = numbers[numbers.length - 1] - start + 1;
  const increasing = numbers.every((number, i) => i === 0 || number > numbers[i - 1]);
  const dense = increasing && span <= MAX_STRETCH * numbers.length;
  return { start: dense ? start : 0, at: Array.from(numbers, (number, i) => (dense ? number - start : i)) };
}

/** @param {Session} session */
function objectName(session) {
  return session.objects[session.selection.object] ?? "";
}

/** The colours of the style sheet under the scheme in force. @returns {Colors} */
function schemeColors() {
  const style = getComputedStyle(document.documentElement);
  const names = /** @type {(keyof Colors)[]} */ (Object.keys(PRINT));
  return /** @type {Colors} */ (
    Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--plot-${name}`).trim()]))
  );
}
