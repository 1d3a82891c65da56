// @ts-check
/** One plot over the frames of a sequence: its canvas, its cursor and what a pointer does. */

import { drawLines } from "../pkg/index.js";
import { fill, h } from "../ui/dom.js";
import { significant } from "../ui/format.js";
import { savePlot } from "./save-plot.js";
import { ZOOM } from "./time-window.js";
import { describe } from "./trajectory.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../pkg/index.js").LineFigure} LineFigure
 * @typedef {import("../pkg/index.js").PlotArea} PlotArea
 * @typedef {import("./time-window.js").TimeWindow} TimeWindow
 * @typedef {import("./trajectory.js").Colors} Colors
 * @typedef {import("./trajectory.js").Plot} Plot
 * @typedef {import("./trajectory.js").Quantity} Quantity
 */

/** In CSS pixels; the smaller one where a plot is narrow. */
const FONT_SIZE = { usual: 11, narrow: 10 };
const NARROW = 400;

export class PlotView {
  #session;
  quantity;
  #time;
  /** @type {{ plot: Plot, area: PlotArea, scale: number } | null} */
  #shown = null;
  #cursor = h("div", { class: "plot-cursor", "aria-hidden": "true" });
  #tooltip = h("div", { class: "plot-tooltip", "aria-hidden": "true", hidden: true });
  #title = h("span", { class: "plot-title" });
  #readout = h("span", { class: "plot-readout" });

  /**
   * @param {Session} session
   * @param {Quantity} quantity
   * @param {TimeWindow} time
   * @param {() => void} onTime another part of the time axis is asked for
   */
  constructor(session, quantity, time, onTime) {
    this.#session = session;
    this.quantity = quantity;
    this.#time = time;
    this.canvas = h("canvas", { class: "plot", role: "img", data: { quantity } });
    this.element = h(
      "figure",
      { class: "plot-figure", data: { quantity } },
      h("figcaption", {}, this.#title, this.#readout, ...this.#saveButtons()),
      h("div", { class: "plot-surface" }, this.canvas, this.#cursor, this.#tooltip),
    );
    this.#listenToPointer();
    listenToWheel(this.canvas, time, onTime, (event) => {
      const index = this.#frameAt(event);
      return index === null || !this.#shown ? null : this.#shown.plot.at[index];
    });
  }

  /** @param {Colors} colors */
  draw(colors) {
    const { canvas } = this;
    this.#shown = null;
    this.#tooltip.hidden = true;
    const { clientWidth, clientHeight } = canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    const scale = window.devicePixelRatio;
    const fontSize = Math.round(
      (clientWidth < NARROW ? FONT_SIZE.narrow : FONT_SIZE.usual) * scale,
    );
    const plot = describe(this.#session, this.quantity, colors, fontSize, this.#time);
    const [width, height] = [clientWidth, clientHeight].map((side) => Math.round(side * scale));
    if (canvas.width !== width || canvas.height !== height)
      Object.assign(canvas, { width, height });
    this.element.dataset.empty = String(plot === null);
    if (plot) {
      const { title, series } = plot.figure;
      this.#shown = { plot, area: drawLines(canvas, bare(plot.figure)), scale };
      this.#title.textContent = title;
      canvas.dataset.points = String(series[0].values.length);
      const labels = series.map(({ label }) => label).join(", ");
      canvas.setAttribute("aria-label", `${title}, over the frames: ${labels}`);
    } else {
      canvas.getContext("2d")?.clearRect(0, 0, width, height);
      canvas.setAttribute("aria-label", "No plot: the object is visible in no frame");
    }
    this.moveCursor();
  }

  /** The frame on display: the line over the plot and the values beside the title. */
  moveCursor() {
    const { score } = this.#session;
    const shown = this.#shown;
    const { from, to } = this.#time;
    const index = score.selection.frame - (score.sequenceOf(score.selection.frame)?.start ?? 0);
    const position = shown?.plot.at[index];
    const isShown = position !== undefined && position >= from && position <= to;
    this.#cursor.hidden = !isShown;
    fill(this.#readout);
    if (!shown || !isShown) return;
    const { plot, area, scale } = shown;
    const x = columnOf(shown, position);
    this.#cursor.style.transform = `translateX(${x}px)`;
    this.#cursor.style.top = `${area.top / scale}px`;
    this.#cursor.style.height = `${(area.bottom - area.top) / scale}px`;
    this.canvas.dataset.cursor = String(x);
    const values = valuesAt(plot, position);
    const told = this.quantity === "error" ? values.slice(0, 1) : values;
    fill(this.#readout, ...told.map(valueView));
  }

  /**
   * Says why there is no plot.
   * @param {string} reason
   */
  fail(reason) {
    this.#title.textContent = reason;
  }

  #saveButtons() {
    const quantity = this.quantity;
    return /** @type {const} */ (["svg", "png"]).map((format) =>
      h(
        "button",
        {
          type: "button",
          class: "link",
          id: `save-plot-${quantity}-${format}`,
          onclick: () => void savePlot(this.#session, quantity, format),
        },
        format.toUpperCase(),
        h("span", { class: "visually-hidden" }, ` of ${quantity} over the frames`),
      ),
    );
  }

  #listenToPointer() {
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      canvas.setPointerCapture(event.pointerId);
      this.#seek(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      this.#point(event);
      if (canvas.hasPointerCapture(event.pointerId)) this.#seek(event);
    });
    canvas.addEventListener("pointerleave", () => (this.#tooltip.hidden = true));
  }

  /**
   * The index in the sequence of the frame nearest to a pointer.
   * @param {MouseEvent} event
   */
  #frameAt(event) {
    if (!this.#shown) return null;
    const { plot, area, scale } = this.#shown;
    const column = (event.clientX - this.canvas.getBoundingClientRect().left) * scale;
    const share = (column - area.left) / Math.max(area.right - area.left, 1);
    const position = plot.from + share * (area.end - area.start);
    let nearest = 0;
    for (const [i, at] of plot.at.entries()) {
      if (Math.abs(at - position) < Math.abs(plot.at[nearest] - position)) nearest = i;
    }
    return nearest;
  }

  /** @param {PointerEvent} event */
  #seek(event) {
    const { score } = this.#session;
    const index = this.#frameAt(event);
    const sequence = score.sequenceOf(score.selection.frame);
    if (index !== null && sequence) score.select({ frame: sequence.start + index });
  }

  /** @param {PointerEvent} event */
  #point(event) {
    const tooltip = this.#tooltip;
    const index = this.#frameAt(event);
    tooltip.hidden = index === null;
    if (index === null || !this.#shown) return;
    const { plot } = this.#shown;
    const number = plot.figure.start + plot.at[index] - plot.from;
    fill(tooltip, h("p", {}, `frame ${number}`), ...valuesAt(plot, plot.at[index]).map(valueView));
    const x = columnOf(this.#shown, plot.at[index]);
    const left = x > this.canvas.clientWidth / 2;
    tooltip.style.transform = `translateX(${left ? x - 10 - tooltip.offsetWidth : x + 10}px)`;
  }
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
