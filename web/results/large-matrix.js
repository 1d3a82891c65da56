// @ts-check
/**
 * The errors of very many keypoints or objects: a heat map that scrolls, of which only the cells in
 * sight are drawn.
 */

import { h } from "../ui/dom.js";
import { onResized } from "../ui/resized.js";

/** @typedef {import("../session.js").Session} Session */

/** The side of a cell, in CSS pixels. */
const CELL = 14;
/** Width of the names of the objects, and height of the numbers of the keypoints. */
const MARGIN = { left: 110, top: 20 };
/** Numbers of keypoints stand over every so many cells. */
const EVERY = 5;
/** From far to close: the ends of the scale are factors of the threshold. */
const SCALE = { from: 100, to: 0.1 };
/** The colour map viridis at equal steps (S. van der Walt, N. Smith). */
const RAMP = [
  [68, 1, 84],
  [72, 40, 120],
  [62, 74, 137],
  [49, 104, 142],
  [38, 130, 142],
  [31, 158, 137],
  [53, 183, 121],
  [109, 205, 89],
  [180, 222, 44],
  [253, 231, 37],
];
const STEPS = new Map([
  ["ArrowUp", [-1, 0]],
  ["ArrowDown", [1, 0]],
  ["ArrowLeft", [0, -1]],
  ["ArrowRight", [0, 1]],
]);

/**
 * @typedef {{ object: number, keypoint: number }} Cell
 *
 * @param {Session} session
 * @param {(cell: Cell) => string} describe
 * @param {(cell: Cell) => void} choose
 */
export function largeMatrix(session, describe, choose) {
  const canvas = h("canvas", { class: "large-canvas", "aria-hidden": "true" });
  const spacer = h("div", { class: "large-spacer" });
  const cell = h("span", { id: "large-cell", role: "gridcell", class: "visually-hidden" });
  const tip = h("p", { class: "hint-line large-tip", "aria-hidden": "true" });
  const scroll = h(
    "div",
    {
      id: "large-matrix",
      class: "large-matrix",
      role: "grid",
      tabIndex: 0,
      "aria-label": "Errors by object and keypoint",
      "aria-activedescendant": "large-cell",
    },
    h("div", { role: "row" }, cell),
    canvas,
    spacer,
  );
  /** @type {Cell} */
  let at = { object: 0, keypoint: 0 };
  const size = () => {
    const errors = session.score.evaluation?.errors ?? [];
    return { objects: errors.length, keypoints: errors[0]?.length ?? 0 };
  };
  const tell = (/** @type {Cell} */ next) => {
    at = next;
    const text = describe(at);
    cell.textContent = text;
    tip.textContent = text;
    cell.setAttribute("aria-rowindex", String(at.object + 1));
    cell.setAttribute("aria-colindex", String(at.keypoint + 1));
    draw();
  };
  const draw = () => {
    drawMatrix(session, canvas, scroll, at);
    // The canvas lies over what scrolls.
    spacer.style.marginTop = `-${canvas.clientHeight}px`;
  };
  scroll.addEventListener("scroll", draw, { passive: true });
  listen(scroll, canvas, { size, tell, choose, at: () => at });
  const update = () => {
    const { objects, keypoints } = size();
    spacer.style.width = `${MARGIN.left + keypoints * CELL}px`;
    spacer.style.height = `${MARGIN.top + objects * CELL}px`;
    scroll.setAttribute("aria-rowcount", String(objects));
    scroll.setAttribute("aria-colcount", String(keypoints));
    const isThere = at.object < objects && at.keypoint < keypoints;
    tell(isThere ? at : { object: 0, keypoint: 0 });
  };
  onResized(scroll, draw);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  return { element: h("div", { class: "large-frame" }, scroll, tip), update };
}

/**
 * Points at cells and chooses them, by pointer and by keys.
 * @param {HTMLElement} scroll
 * @param {HTMLCanvasElement} canvas
 * @param {{ size: () => { objects: number, keypoints: number }, tell: (cell: Cell) => void,
 * choose: (cell: Cell) => void, at: () => Cell }} matrix
 */
function listen(scroll, canvas, { size, tell, choose, at }) {
  const cellAt = (/** @type {MouseEvent} */ event) => {
    const box = canvas.getBoundingClientRect();
    const x = event.clientX - box.left - MARGIN.left;
    const y = event.clientY - box.top - MARGIN.top;
    if (x < 0 || y < 0) return null;
    const found = {
      object: Math.floor((y + scroll.scrollTop) / CELL),
      keypoint: Math.floor((x + scroll.scrollLeft) / CELL),
    };
    const { objects, keypoints } = size();
    return found.object < objects && found.keypoint < keypoints ? found : null;
  };
  scroll.addEventListener("pointermove", (event) => {
    const found = cellAt(event);
    const { object, keypoint } = at();
    if (found && (found.object !== object || found.keypoint !== keypoint)) tell(found);
  });
  scroll.addEventListener("click", (event) => {
    const found = cellAt(event);
    if (!found) return;
    tell(found);
    choose(found);
  });
  scroll.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === "Enter" || event.key === " ") choose(at());
    else {
      const next = neighbour(at(), event.key, size());
      if (!next) return;
      follow(scroll, next);
      tell(next);
    }
    event.preventDefault();
  });
}

/**
 * Where a key leads to; `null` for other keys.
 * @param {Cell} from
 * @param {string} key
 * @param {{ objects: number, keypoints: number }} size
 */
function neighbour({ object, keypoint }, key, { objects, keypoints }) {
  if (key === "Home") return { object, keypoint: 0 };
  if (key === "End") return { object, keypoint: keypoints - 1 };
  const step = STEPS.get(key);
  if (!step) return null;
  const clamp = (/** @type {number} */ value, /** @type {number} */ count) =>
    Math.min(Math.max(value, 0), count - 1);
  return { object: clamp(object + step[0], objects), keypoint: clamp(keypoint + step[1], keypoints) };
}

/**
 * Brings a cell into sight.
 * @param {HTMLElement} scroll
 * @param {Cell} cell
 */
function follow(scroll, { object, keypoint }) {
  const [x, y] = [keypoint * CELL, object * CELL];
  const width = scroll.clientWidth - MARGIN.left - CELL;
  const height = scroll.clientHeight - MARGIN.top - CELL;
  scroll.scrollLeft = Math.min(Math.max(scroll.scrollLeft, x - width), x);
  scroll.scrollTop = Math.min(Math.max(scroll.scrollTop, y - height), y);
}

/**
 * @param {Session} session
 * @param {HTMLCanvasElement} canvas
 * @param {HTMLElement} scroll
 * @param {Cell} at
 */
function drawMatrix({ score }, canvas, scroll, at) {
  const { clientWidth: width, clientHeight: height, scrollLeft, scrollTop } = scroll;
  const { evaluation } = score;
  const context = canvas.getContext("2d");
  if (!evaluation || !context || width === 0) return;
  const ratio = window.devicePixelRatio;
  Object.assign(canvas, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
  canvas.style.width = `${width}px`;
  canvas.style.height = `${height}px`;
  context.scale(ratio, ratio);
  const style = getComputedStyle(document.documentElement);
  const [text, surface] = ["--text", "--surface"].map((name) => style.getPropertyValue(name));
  const left = (/** @type {number} */ keypoint) => MARGIN.left + keypoint * CELL - scrollLeft;
  const top = (/** @type {number} */ object) => MARGIN.top + object * CELL - scrollTop;
  const first = { object: Math.floor(scrollTop / CELL), keypoint: Math.floor(scrollLeft / CELL) };
  const columns = Math.ceil((width - MARGIN.left) / CELL) + 1;
  const rows = Math.ceil((height - MARGIN.top) / CELL) + 1;
  context.save();
  context.beginPath();
  context.rect(MARGIN.left, MARGIN.top, width, height);
  context.clip();
  for (const [i, errors] of evaluation.errors.slice(first.object, first.object + rows).entries()) {
    const object = first.object + i;
    const { threshold, best_keypoint: best } = evaluation.objects[object];
    const end = Math.min(errors.length, first.keypoint + columns);
    for (let keypoint = first.keypoint; keypoint < end; keypoint++) {
      const [x, y] = [left(keypoint), top(object)];
      context.fillStyle = colorOf(errors[keypoint], threshold);
      context.fillRect(x, y, CELL - 1, CELL - 1);
      const isShown = score.keypointOf(object) === keypoint;
      if (keypoint === best || isShown) outline(context, x, y, isShown ? "#ff5f57" : "#ffffff");
      if (object === at.object && keypoint === at.keypoint) outline(context, x - 1, y - 1, text);
    }
  }
  context.restore();
  context.fillStyle = surface;
  context.fillRect(0, 0, MARGIN.left, height);
  context.fillRect(0, 0, width, MARGIN.top);
  context.fillStyle = text;
  context.font = "11px system-ui, sans-serif";
  context.textBaseline = "middle";
  const names = evaluation.objects.slice(first.object, first.object + rows);
  for (const [i, { name }] of names.entries()) {
    const y = top(first.object + i) + CELL / 2;
    if (y > MARGIN.top) context.fillText(name, 2, y, MARGIN.left - 8);
  }
  for (let keypoint = first.keypoint; keypoint < first.keypoint + columns; keypoint++) {
    const isThere = keypoint < (evaluation.errors[0]?.length ?? 0);
    if (keypoint % EVERY === 0 && isThere && left(keypoint) >= MARGIN.left)
      context.fillText(String(keypoint), left(keypoint), MARGIN.top / 2);
  }
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number} x
 * @param {number} y
 * @param {string} color
 */
function outline(context, x, y, color) {
  context.strokeStyle = color;
  context.lineWidth = 2;
  context.strokeRect(x + 1, y + 1, CELL - 3, CELL - 3);
}

/**
 * @param {number | null} error
 * @param {number} threshold
 */
function colorOf(error, threshold) {
  if (error === null || Number.isNaN(error)) return "#808890";
  const share = Math.log(error / threshold / SCALE.from) / Math.log(SCALE.to / SCALE.from);
  const position = Math.min(1, Math.max(0, share)) * (RAMP.length - 1);
  const step = Math.min(Math.floor(position), RAMP.length - 2);
  const part = (/** @type {number} */ c) =>
    Math.round(RAMP[step][c] + (position - step) * (RAMP[step + 1][c] - RAMP[step][c]));
  return `rgb(${part(0)} ${part(1)} ${part(2)})`;
}
