// @ts-check
/**
 * x(t), y(t) and the error over a sequence: drawn by plotters onto canvases that follow and move
 * the frame.
 */

import { messageOf } from "../errors.js";
import init, { drawLines, linesToSvg } from "../pkg/index.js";
import { fill, h, icon } from "../ui/dom.js";
import { save } from "../ui/download.js";
import { significant } from "../ui/format.js";
import { TimeWindow } from "./time-window.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../pkg/index.js").LineFigure} LineFigure
 * @typedef {import("../pkg/index.js").PlotArea} PlotArea
 * @typedef {"x" | "y" | "error"} Quantity
 * @typedef {Record<"truth" | "keypoint" | "transformed" | "error" | "foreground" | "background" |
 * "grid", string>} Colors
 *
 * A figure with the positions of the frames on the axis, and the first position that it shows.
 * @typedef {{ figure: LineFigure, at: number[], from: number, marks: (keyof Colors)[] }} Plot
 */

/** @type {Quantity[]} */
const QUANTITIES = ["x", "y", "error"];
/** In CSS pixels; the smaller one where a plot is narrow. */
const FONT_SIZE = { usual: 11, narrow: 10 };
const NARROW = 400;
const SAVED = { width: 720, height: 320, fontSize: 14, pixels: 3 };
/** Frame numbers further apart than this many times their count are drawn one after the other. */
const MAX_STRETCH = 20;
/** A longer axis can be zoomed. */
const LEAST_TO_ZOOM = 5;
/** What a press of a button or a turn of the wheel zooms the time axis by. */
const ZOOM = 1.5;

/** For print, whatever the scheme of the page. @type {Colors} */
const PRINT = {
  truth: "#1b1f24",
  keypoint: "#d0342c",
  transformed: "#1f6feb",
  error: "#1f6feb",
  foreground: "#1b1f24",
  background: "#ffffff",
  grid: "#e3e7eb",
};

/** @param {Session} session */
export function plots(session) {
  const time = new TimeWindow();
  let sequence = "";
  const changed = () => {
    all.disabled = !time.isZoomed;
    schedule();
  };
  const views = QUANTITIES.map((quantity) => plotView(session, quantity, time, changed));
  const { buttons, all } = zoomButtons(session, time, changed);
  let scheduled = false;
  let drawn = "";
  const pair = () => {
    const { object, frame } = session.score.selection;
    return (
      `${object} ${session.score.keypointOf(object)} ` + `${session.score.sequenceOf(frame)?.start}`
    );
  };
  const draw = async () => {
    scheduled = false;
    if (!session.score.shown?.scoring) return;
    drawn = pair();
    const axis = axisOnDisplay(session);
    const shown = JSON.stringify(session.score.sequenceOf(session.score.selection.frame));
    if (shown !== sequence || axis.length !== time.length) time.reset(axis.length);
    sequence = shown;
    buttons.hidden = axis.length <= LEAST_TO_ZOOM;
    all.disabled = !time.isZoomed;
    try {
      // Loaded when there is something to draw.
      await init(["figures"]);
    } catch (error) {
      const reason = messageOf(error);
      for (const view of views) view.fail(`No plot: ${reason}. Reload the page to try again.`);
      return;
    }
    const colors = schemeColors();
    for (const view of views) view.draw(colors);
  };
  const schedule = () => {
    if (scheduled) return;
    scheduled = true;
    requestAnimationFrame(() => void draw());
  };
  // While frames go by only the cursor moves.
  const follow = () => {
    if (pair() !== drawn || time.follow(axisOnDisplay(session).position)) schedule();
    for (const view of views) view.moveCursor();
  };
  session.score.addEventListener("selection", follow);
  for (const topic of ["scoring", "evaluation", "preview"]) session.score.addEventListener(topic, schedule);
  // Zooming changes the pixels of a canvas without changing its size in the layout.
  window.addEventListener("resize", schedule);
  const resized = new ResizeObserver(schedule);
  for (const { canvas } of views) resized.observe(canvas);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", schedule);
  return { elements: views.map(({ element }) => element), zoom: buttons };
}

/**
 * Buttons that zoom the time axis.
 * @param {Session} session
 * @param {TimeWindow} time
 * @param {() => void} changed
 */
function zoomButtons(session, time, changed) {
  const button = (
    /** @type {string} */ symbol,
    /** @type {string} */ label,
    /** @type {() => void} */ change,
  ) => {
    const names = { "aria-label": label, title: label };
    const onclick = () => {
      change();
      changed();
    };
    return h("button", { type: "button", class: "button round", ...names, onclick }, icon(symbol));
  };
  const at = () => axisOnDisplay(session).position;
  const all = button("icon-fit", "All of the sequence", () => time.reset(time.length));
  const buttons = h(
    "div",
    { class: "zoom", role: "group", "aria-label": "Zoom of the time axis", id: "zoom-time" },
    button("icon-none", "Zoom out in time", () => time.zoom(1 / ZOOM, at())),
    button("icon-plus", "Zoom in on this frame in time", () => time.zoom(ZOOM, at())),
    all,
  );
  return { buttons, all: /** @type {HTMLButtonElement} */ (all) };
}

/**
 * The length of the axis of the sequence on display, and where the frame on display is on it.
 * @param {Session} session
 */
function axisOnDisplay({ score }) {
  const range = score.sequenceOf(score.selection.frame);
  if (!range) return { length: 1, position: 0 };
  const { at } = axisOf(score.frameNumbers.subarray(range.start, range.start + range.length));
  return { length: at[at.length - 1] + 1, position: at[score.selection.frame - range.start] };
}

/**
 * @param {Session} session
 * @param {Quantity} quantity
 * @param {TimeWindow} time
 * @param {() => void} onTime another part of the time axis is asked for
 */
function plotView(session, quantity, time, onTime) {
  const canvas = h("canvas", { class: "plot", role: "img", data: { quantity } });
  const cursor = h("div", { class: "plot-cursor", "aria-hidden": "true" });
  const tooltip = h("div", { class: "plot-tooltip", "aria-hidden": "true", hidden: true });
  const surface = h("div", { class: "plot-surface" }, canvas, cursor, tooltip);
  const title = h("span", { class: "plot-title" });
  const readout = h("span", { class: "plot-readout" });
  const saved = /** @type {const} */ (["svg", "png"]).map((format) =>
    h(
      "button",
      {
        type: "button",
        class: "link",
        id: `save-plot-${quantity}-${format}`,
        onclick: () => void savePlot(session, quantity, format),
      },
      format.toUpperCase(),
      h("span", { class: "visually-hidden" }, ` of ${quantity} over the frames`),
    ),
  );
  const element = h(
    "figure",
    { class: "plot-figure", data: { quantity } },
    h("figcaption", {}, title, readout, ...saved),
    surface,
  );

  /** @type {{ plot: Plot, area: PlotArea, scale: number } | null} */
  let shown = null;

  /** @param {Colors} colors */
  const draw = (colors) => {
    shown = null;
    tooltip.hidden = true;
    const { clientWidth, clientHeight } = canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    const scale = window.devicePixelRatio;
    const fontSize = clientWidth < NARROW ? FONT_SIZE.narrow : FONT_SIZE.usual;
    const plot = describe(session, quantity, colors, Math.round(fontSize * scale), time);
    const [width, height] = [clientWidth, clientHeight].map((side) => Math.round(side * scale));
    if (canvas.width !== width || canvas.height !== height)
      Object.assign(canvas, { width, height });
    element.dataset.empty = String(plot === null);
    if (!plot) {
      canvas.getContext("2d")?.clearRect(0, 0, width, height);
      canvas.setAttribute("aria-label", "No plot: the object is visible in no frame");
      moveCursor();
      return;
    }
    const area = drawLines(canvas, bare(plot.figure));
    shown = { plot, area, scale };
    title.textContent = plot.figure.title;
    canvas.dataset.points = String(plot.figure.series[0].values.length);
    const labels = plot.figure.series.map(({ label }) => label).join(", ");
    canvas.setAttribute("aria-label", `${plot.figure.title}, over the frames: ${labels}`);
    moveCursor();
  };

  /** The frame on display: the line over the plot and the values beside the title. */
  const moveCursor = () => {
    const sequence = session.score.sequenceOf(session.score.selection.frame);
    const index = session.score.selection.frame - (sequence?.start ?? 0);
    const isShown = (/** @type {number} */ position) => position >= time.from && position <= time.to;
    cursor.hidden = !shown || index >= shown.plot.at.length || !isShown(shown.plot.at[index]);
    fill(readout);
    if (!shown || cursor.hidden) return;
    const { plot, area, scale } = shown;
    const x = columnOf(shown, plot.at[index]);
    cursor.style.transform = `translateX(${x}px)`;
    cursor.style.top = `${area.top / scale}px`;
    cursor.style.height = `${(area.bottom - area.top) / scale}px`;
    canvas.dataset.cursor = String(x);
    const values = valuesAt(plot, plot.at[index]);
    fill(readout, ...(quantity === "error" ? values.slice(0, 1) : values).map(valueView));
  };

  /**
   * The index in the sequence of the frame nearest to a pointer.
   * @param {MouseEvent} event
   */
  const frameAt = (event) => {
    if (!shown) return null;
    const { plot, area, scale } = shown;
    const column = (event.clientX - canvas.getBoundingClientRect().left) * scale;
    const share = (column - area.left) / Math.max(area.right - area.left, 1);
    const position = plot.from + share * (area.end - area.start);
    let nearest = 0;
    for (const [i, at] of plot.at.entries()) {
      if (Math.abs(at - position) < Math.abs(plot.at[nearest] - position)) nearest = i;
    }
    return nearest;
  };
  const seek = (/** @type {PointerEvent} */ event) => {
    const index = frameAt(event);
    const sequence = session.score.sequenceOf(session.score.selection.frame);
    if (index !== null && sequence) session.score.select({ frame: sequence.start + index });
  };
  const point = (/** @type {PointerEvent} */ event) => {
    const index = frameAt(event);
    tooltip.hidden = index === null;
    if (index === null || !shown) return;
    const { plot } = shown;
    const number = plot.figure.start + plot.at[index] - plot.from;
    fill(tooltip, h("p", {}, `frame ${number}`), ...valuesAt(plot, plot.at[index]).map(valueView));
    const x = columnOf(shown, plot.at[index]);
    const left = x > canvas.clientWidth / 2;
    tooltip.style.transform = `translateX(${left ? x - 10 - tooltip.offsetWidth : x + 10}px)`;
  };
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    seek(event);
  });
  canvas.addEventListener("pointermove", (event) => {
    point(event);
    if (canvas.hasPointerCapture(event.pointerId)) seek(event);
  });
  canvas.addEventListener("pointerleave", () => (tooltip.hidden = true));
  listenToWheel(canvas, time, onTime, (event) => {
    const index = frameAt(event);
    return index === null || !shown ? null : shown.plot.at[index];
  });
  /** @param {string} reason */
  const fail = (reason) => (title.textContent = reason);
  return { element, canvas, draw, moveCursor, fail };
}

/**
 * Zooms in time by a pinch or the wheel with Ctrl, and pans by the wheel sideways.
 * @param {HTMLElement} canvas
 * @param {TimeWindow} time
 * @param {() => void} onTime
 * @param {(event: MouseEvent) => number | null} positionAt
 */
function listenToWheel(canvas, time, onTime, positionAt) {
  canvas.addEventListener(
    "wheel",
    (event) => {
      const at = positionAt(event);
      const sideways = event.shiftKey ? event.deltaX || event.deltaY : event.deltaX;
      if (at === null) return;
      if (event.ctrlKey) time.zoom(event.deltaY < 0 ? ZOOM : 1 / ZOOM, at);
      else if (sideways !== 0 && time.isZoomed)
        time.pan((Math.sign(sideways) * (time.to - time.from)) / 8 || Math.sign(sideways));
      else return;
      event.preventDefault();
      onTime();
    },
    { passive: false },
  );
}

/**
 * A figure whose title, legend and units stand beside it.
 * @param {LineFigure} figure
 * @returns {LineFigure}
 */
function bare(figure) {
  const series = figure.series.map((line) => ({ ...line, label: "" }));
  return { ...figure, series, title: "", xLabel: "", yLabel: "", cursor: null };
}

/**
 * In CSS pixels from the left of the canvas.
 * @param {{ plot: Plot, area: PlotArea, scale: number }} shown
 * @param {number} position on the axis, from its start
 */
function columnOf({ plot, area, scale }, position) {
  const share = (position - plot.from) / (area.end - area.start);
  return (area.left + share * (area.right - area.left)) / scale;
}

/**
 * What the lines of a plot say at a position, the most important first.
 * @param {Plot} plot
 * @param {number} position
 */
function valuesAt({ figure, from, marks }, position) {
  return figure.series
    .map(({ label, values }, i) => ({ label, mark: marks[i], value: values[position - from] }))
    .reverse();
}

/** @param {{ label: string, mark: string, value: number }} line */
function valueView({ label, mark, value }) {
  return h(
    "span",
    { class: "plot-value", data: { mark } },
    h("span", { class: "plot-swatch" }),
    `${label} ${Number.isNaN(value) ? "not visible" : significant(value)}`,
  );
}

/**
 * @param {Session} session
 * @param {Quantity} quantity
 * @param {"svg" | "png"} format
 */
async function savePlot(session, quantity, format) {
  const plot = describe(
    session,
    quantity,
    PRINT,
    SAVED.fontSize * (format === "png" ? SAVED.pixels : 1),
  );
  if (!plot) return;
  const figure = { ...plot.figure, cursor: null };
  const sequence = session.score.sequenceOf(session.score.selection.frame)?.name;
  const file = `${objectName(session)}-${quantity}-${sequence}.${format}`.replace(/[^\w.-]+/g, "_");
  if (format === "svg") {
    save(file, "image/svg+xml", linesToSvg(figure, SAVED.width, SAVED.height));
    return;
  }
  const canvas = document.createElement("canvas");
  Object.assign(canvas, { width: SAVED.width * SAVED.pixels, height: SAVED.height * SAVED.pixels });
  drawLines(canvas, figure);
  /** @type {Blob | null} */
  const image = await new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
  if (image) save(file, "image/png", image);
}

/**
 * @param {Session} session
 * @param {Quantity} quantity
 * @param {Colors} colors
 * @param {number} fontSize
 * @param {{ from: number, to: number }} [time] positions to show; all where it is not given
 * @returns {Plot | null}
 */
function describe(session, quantity, colors, fontSize, time) {
  const { judged, selection } = session.score;
  const keypoint = session.score.keypointOf(selection.object);
  const series = session.score.series(selection.object);
  const sequence = session.score.sequenceOf(selection.frame);
  if (!series || !sequence || (quantity === "error" && !judged)) return null;
  const { start, at } = axisOf(
    session.score.frameNumbers.subarray(sequence.start, sequence.start + sequence.length),
  );
  const from = time?.from ?? 0;
  const length = Math.min(time?.to ?? Infinity, at[at.length - 1]) - from + 1;
  const line = (
    /** @type {string} */ label,
    /** @type {string} */ color,
    /** @type {(frame: number) => number} */ value,
  ) => {
    const values = new Float64Array(length).fill(NaN);
    at.forEach((position, i) => {
      const shown = position - from;
      if (shown >= 0 && shown < length) values[shown] = value(sequence.start + i);
    });
    return { label, color, values };
  };
  const threshold = judged?.objects[selection.object].threshold ?? NaN;
  const coordinate = (/** @type {Float64Array} */ points) => (/** @type {number} */ t) =>
    points[2 * t + (quantity === "y" ? 1 : 0)];
  const isError = quantity === "error";
  const figure = {
    title: isError ? "squared distance" : `${quantity} of ${objectName(session)}`,
    xLabel: "frame",
    yLabel: isError ? "e (ndc²)" : `${quantity} (ndc)`,
    start: start + from,
    series: isError
      ? [
          line("threshold", colors.foreground, () => threshold),
          line("error", colors.error, (t) => series.distances[t]),
        ]
      : [
          line(`keypoint ${keypoint}`, colors.keypoint, coordinate(series.keypoint)),
          line("truth", colors.truth, coordinate(series.truth)),
          line("transformed", colors.transformed, coordinate(series.transformed)),
        ].filter((_, i) => keypoint !== null || i === 1),
    cursor: at[selection.frame - sequence.start] - from,
    fromZero: isError,
    foreground: colors.foreground,
    background: colors.background,
    grid: colors.grid,
    fontSize,
  };
  /** @type {(keyof Colors)[]} */
  const marks = isError
    ? ["foreground", "error"]
    : keypoint === null
      ? ["truth"]
      : ["keypoint", "truth", "transformed"];
  return { figure, at, from, marks };
}

/**
 * Where each frame of a sequence stands on the axis. Missing frames leave gaps, unless most are
 * missing.
 * @param {Float64Array} numbers
 */
function axisOf(numbers) {
  const start = numbers[0];
  const span = numbers[numbers.length - 1] - start + 1;
  const increasing = numbers.every((number, i) => i === 0 || number > numbers[i - 1]);
  const dense = increasing && span <= MAX_STRETCH * numbers.length;
  return {
    start: dense ? start : 0,
    at: Array.from(numbers, (number, i) => (dense ? number - start : i)),
  };
}

/** @param {Session} session */
function objectName(session) {
  return session.score.objects[session.score.selection.object] ?? "";
}

/** The colours of the style sheet under the scheme in force. @returns {Colors} */
function schemeColors() {
  const style = getComputedStyle(document.documentElement);
  const names = /** @type {(keyof Colors)[]} */ (Object.keys(PRINT));
  return /** @type {Colors} */ (
    Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--plot-${name}`).trim()]))
  );
}
