// @ts-check
/**
 * The errors of all keypoints for all objects: a heat map whose cells choose the keypoint on
 * display.
 */

import { matrixFigure } from "../pkg/index.js";
import { fill, h } from "../ui/dom.js";
import { significant } from "../ui/format.js";
import { figureView } from "./figure.js";

/** @typedef {import("../session.js").Session} Session */

/** @type {Record<string, [number, number]>} */
const STEPS = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };

/** @param {Session} session */
export function matrixView(session) {
  const note = h("p", { class: "hint-line" });
  const reset = h(
    "button",
    {
      type: "button",
      class: "button",
      id: "choose-best",
      onclick: () => session.score.chooseBest(),
    },
    "Back to the best keypoints",
  );
  /** The cell that the keys move from. */
  let at = { object: 0, keypoint: 0 };
  /** @type {HTMLElement[][]} */
  let cells = [];

  const figure = figureView({
    id: "errors",
    label: "Tracking error of every keypoint for every object",
    draw: (theme, width) => {
      const { evaluation } = session.score;
      if (!evaluation) return null;
      const chosen = Int32Array.from(evaluation.objects, (_, k) =>
        session.score.isChosen(k) ? (session.score.keypointOf(k) ?? -1) : -1,
      );
      return matrixFigure(evaluation, chosen, theme, width);
    },
    drawn: (drawn, layer) => {
      const { evaluation } = session.score;
      if (!evaluation) return;
      const [left, top, width, height] = drawn.plot;
      const columns = evaluation.errors[0].length;
      const focused = layer.contains(document.activeElement);
      cells = evaluation.errors.map((errors, object) =>
        errors.map((_, keypoint) => {
          const cell = h("div", {
            role: "gridcell",
            class: "matrix-cell",
            tabIndex: -1,
            "aria-label": describe(session, object, keypoint),
            "aria-selected": String(session.score.keypointOf(object) === keypoint),
            data: { object, keypoint },
          });
          cell.style.width = `${width / columns}px`;
          return cell;
        }),
      );
      const rows = cells.map((row) => h("div", { role: "row", class: "matrix-row" }, ...row));
      const grid = h(
        "div",
        { role: "grid", class: "matrix-grid", "aria-label": "Errors by object and keypoint" },
        ...rows,
      );
      Object.assign(grid.style, {
        left: `${left}px`,
        top: `${top}px`,
        width: `${width}px`,
        height: `${height}px`,
      });
      fill(layer, grid);
      at = {
        object: Math.min(at.object, cells.length - 1),
        keypoint: Math.min(at.keypoint, columns - 1),
      };
      const current = cells[at.object][at.keypoint];
      current.tabIndex = 0;
      if (focused) current.focus({ preventScroll: true });
    },
  });

  const cellOf = (/** @type {Event} */ event) =>
    event.target instanceof HTMLElement && event.target.dataset.keypoint !== undefined
      ? event.target
      : null;
  const tell = (/** @type {Event} */ event) => {
    const cell = cellOf(event);
    const drawn = figure.drawing();
    if (!cell || !drawn) return figure.showTip(null);
    const { object, keypoint } = positionOf(cell);
    const [left, top, width, height] = drawn.plot;
    const x = left + ((keypoint + 0.5) * width) / cells[0].length;
    figure.showTip(
      describe(session, object, keypoint),
      x,
      top + ((object + 1) * height) / cells.length,
    );
  };
  const choose = (/** @type {HTMLElement} */ cell) => {
    at = positionOf(cell);
    const best = session.score.evaluation?.objects[at.object].best_keypoint;
    // Of a saved evaluation there is nothing else to show with another keypoint.
    if (best === null || best === undefined || !session.score.scoring) return;
    session.score.choose(at.object, at.keypoint === best ? null : at.keypoint);
  };
  figure.layer.addEventListener("pointerover", tell);
  figure.layer.addEventListener("pointerleave", () => figure.showTip(null));
  figure.layer.addEventListener("focusin", tell);
  figure.layer.addEventListener("focusout", () => figure.showTip(null));
  figure.layer.addEventListener("click", (event) => {
    const cell = cellOf(event);
    if (cell) choose(cell);
  });
  figure.layer.addEventListener("keydown", (event) => {
    const cell = cellOf(event);
    if (!cell || event.ctrlKey || event.altKey || event.metaKey) return;
    const { object, keypoint } = positionOf(cell);
    const last = cells[0].length - 1;
    const [down, right] = STEPS[event.key] ?? [0, 0];
    let next = { object: object + down, keypoint: keypoint + right };
    if (event.key === "Home") next = { object, keypoint: 0 };
    else if (event.key === "End") next = { object, keypoint: last };
    else if (event.key === "Enter" || event.key === " ") choose(cell);
    else if (!(event.key in STEPS)) return;
    event.preventDefault();
    if (!cells[next.object]?.[next.keypoint]) return;
    cells[at.object][at.keypoint].tabIndex = -1;
    at = next;
    const target = cells[next.object][next.keypoint];
    target.tabIndex = 0;
    target.focus();
  });

  const element = h(
    "section",
    { class: "panel", "aria-labelledby": "matrix-title" },
    h(
      "div",
      { class: "panel-head" },
      h("h3", { id: "matrix-title" }, "Every keypoint for every object"),
      reset,
    ),
    note,
    figure.element,
  );
  const update = () => {
    const chosen = session.score.objects.filter((_, object) => session.score.isChosen(object));
    reset.hidden = chosen.length === 0;
    note.textContent =
      chosen.length === 0
        ? "Brighter is closer. Outlined: the best keypoint. A dot: the error is up to the " +
          "threshold." +
          (session.score.scoring
            ? " Choose a cell to see that keypoint in the frames and plots."
            : "")
        : `Shown in the frames and plots: ${chosen
            .map(
              (name) =>
                `${name} with keypoint ` +
                `${session.score.keypointOf(session.score.objects.indexOf(name))}`,
            )
            .join(", ")}. The score stays that of the best keypoints.`;
    figure.update();
  };
  return { element, update };
}

/** @param {HTMLElement} cell */
function positionOf(cell) {
  return { object: Number(cell.dataset.object), keypoint: Number(cell.dataset.keypoint) };
}

/**
 * @param {Session} session
 * @param {number} object
 * @param {number} keypoint
 */
function describe(session, object, keypoint) {
  const result = session.score.evaluation?.objects[object];
  const error = session.score.evaluation?.errors[object][keypoint];
  if (!result) return "";
  const what = `${result.name}, keypoint ${keypoint}`;
  if (error === null || error === undefined) return `${what}: the object is never visible`;
  const notes = [
    error <= result.threshold
      ? "up to the threshold"
      : `${significant(error / result.threshold)} × the threshold`,
    keypoint === result.best_keypoint && "best",
    session.score.keypointOf(object) === keypoint && "on display",
  ];
  return `${what}: error ${significant(error)}, ${notes.filter(Boolean).join(", ")}`;
}
