// @ts-check
/**
 * x(t), y(t), in space z(t), and the error over a sequence: drawn by plotters onto canvases that follow and move
 * the frame.
 */

import { messageOf } from "../errors.js";
import init from "../pkg/index.js";
import { h, icon } from "../ui/dom.js";
import { PlotView } from "./plot.js";
import { TimeWindow, ZOOM } from "./time-window.js";
import { axisOf } from "./trajectory.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./trajectory.js").Colors} Colors
 * @typedef {import("./trajectory.js").Quantity} Quantity
 */

/** @type {Quantity[]} */
const QUANTITIES = ["x", "y", "z", "error"];
/** A longer axis can be zoomed. */
const LEAST_TO_ZOOM = 5;
/** @type {(keyof Colors)[]} */
const COLORS = ["truth", "keypoint", "transformed", "error", "foreground", "background", "grid"];

/** @param {Session} session */
export function plots(session) {
  const time = new TimeWindow();
  let sequence = "";
  const changed = () => {
    all.disabled = !time.isZoomed;
    schedule();
  };
  const views = QUANTITIES.map((quantity) => new PlotView(session, quantity, time, changed));
  const [, before, height] = views;
  const { buttons, all } = zoomButtons(session, time, changed);
  let scheduled = false;
  let drawn = "";
  const pair = () => {
    const { object, frame } = session.score.selection;
    const start = session.score.sequenceOf(frame)?.start;
    return `${object} ${session.score.keypointOf(object)} ${start}`;
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
    // Only in space there is a z.
    if (!session.score.isInSpace) height.element.remove();
    else if (!height.element.isConnected) before.element.after(height.element);
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
  for (const topic of ["scoring", "evaluation", "preview"])
    session.score.addEventListener(topic, schedule);
  // Zooming changes the pixels of a canvas without changing its size in the layout.
  window.addEventListener("resize", schedule);
  const resized = new ResizeObserver(schedule);
  for (const { canvas } of views) resized.observe(canvas);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", schedule);
  const elements = views.filter((view) => view !== height).map(({ element }) => element);
  return { elements, zoom: buttons };
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

/** The colours of the style sheet under the scheme in force. @returns {Colors} */
function schemeColors() {
  const style = getComputedStyle(document.documentElement);
  return /** @type {Colors} */ (
    Object.fromEntries(
      COLORS.map((name) => [name, style.getPropertyValue(`--plot-${name}`).trim()]),
    )
  );
}
