// @ts-check
/**
 * The errors of all keypoints for all objects: a heat map whose cells choose the keypoint on
 * display.
 */

import { matrixFigure } from "../pkg/index.js";
import { byId, fill, h } from "../ui/dom.js";
import { significant } from "../ui/format.js";
import { figureView } from "./figure.js";
import { largeMatrix } from "./large-matrix.js";

/** @typedef {import("../session.js").Session} Session */

/** @type {Record<string, [number, number]>} */
const STEPS = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };

/** A figure with more columns or rows is drawn where it is in sight. */
const MOST = { keypoints: 256, objects: 48 };

/** @param {Session} session */
export function matrixView(session) {
  const { score } = session;
  const errors = score.evaluation?.errors ?? [];
  const isLarge = errors.length > MOST.objects || (errors[0]?.length ?? 0) > MOST.keypoints;
  const note = h("p", { class: "hint-line" });
  const reset = h(
    "button",
    { type: "button", class: "button", id: "choose-best", onclick: () => score.chooseBest() },
    "Back to the best keypoints",
  );
  const cells = isLarge ? largeView(session) : figureOf(session);
  const title = h("h3", { id: "matrix-title" }, "Every keypoint for every object");
  const element = h(
    "section",
    { class: "panel", "aria-labelledby": "matrix-title" },
    h("div", { class: "panel-head" }, title, reset),
    note,
    cells.element,
  );
  const update = () => {
    const chosen = score.objects.filter((_, object) => score.isChosen(object));
    reset.hidden = chosen.length === 0;
    note.textContent = chosen.length === 0 ? legendText(session) : chosenText(session, chosen);
    cells.update();
  };
  return { element, update };
}

/** @param {Session} session */
function largeView(session) {
  return largeMatrix(
    session,
    ({ object, keypoint }) => describe(session, object, keypoint),
    ({ object, keypoint }) => choose(session, object, keypoint),
  );
}

/** @param {Session} session */
function figureOf(session) {
  const { score } = session;
  const grid = new Grid(session);
  const figure = figureView({
    id: "errors",
    label: "Tracking error of every keypoint for every object",
    draw: (theme, width) => {
      const { evaluation } = score;
      if (!evaluation) return null;
      const chosen = evaluation.objects.map((_, k) =>
        score.isChosen(k) ? (score.keypointOf(k) ?? -1) : -1,
      );
      return matrixFigure(evaluation, Int32Array.from(chosen), theme, width);
    },
    drawn: (drawn, layer) => grid.rebuild(drawn, layer),
  });
  showTips(session, figure, grid);
  grid.listen(figure.layer);
  return { element: figure.element, update: figure.update };
}

/** @param {Session} session */
function legendText({ score }) {
  const legend =
    "Brighter is closer. Outlined: the best keypoint. A dot: the error is at most the threshold.";
  const way = " Choose a cell to see that keypoint in the frames and plots.";
  return legend + (score.scoring ? way : "");
}

/**
 * @param {Session} session
 * @param {string[]} objects shown with other keypoints than the best ones
 */
function chosenText({ score }, objects) {
  const pairs = objects.map(
    (name) => `${name} with keypoint ${score.keypointOf(score.objects.indexOf(name))}`,
  );
  return (
    `Shown in the frames and plots: ${pairs.join(", ")}. The score stays that of the best ` +
    "keypoints."
  );
}

/** The cells over the figure: a grid that is moved through by keys. */
class Grid {
  /** By object and keypoint. @type {HTMLElement[][]} */
  cells = [];
  #session;
  /** The cell that the keys move from. */
  #at = { object: 0, keypoint: 0 };

  /** @param {Session} session */
  constructor(session) {
    this.#session = session;
  }

  /**
   * @param {import("../pkg/index.js").Drawn} drawn
   * @param {HTMLElement} layer
   */
  rebuild({ plot: [left, top, width, height] }, layer) {
    const { evaluation } = this.#session.score;
    if (!evaluation) return;
    const columns = evaluation.errors[0].length;
    const isFocused = layer.contains(document.activeElement);
    this.cells = evaluation.errors.map((errors, object) =>
      errors.map((_, keypoint) => this.#cell(object, keypoint, width / columns)),
    );
    const rows = this.cells.map((row) => h("div", { role: "row", class: "matrix-row" }, ...row));
    const grid = h(
      "div",
      { role: "grid", class: "matrix-grid", "aria-label": "Errors by object and keypoint" },
      ...rows,
    );
    const box = { left, top, width, height };
    for (const [side, value] of Object.entries(box)) grid.style.setProperty(side, `${value}px`);
    fill(layer, grid);
    this.#at = {
      object: Math.min(this.#at.object, this.cells.length - 1),
      keypoint: Math.min(this.#at.keypoint, columns - 1),
    };
    const current = this.cells[this.#at.object][this.#at.keypoint];
    current.tabIndex = 0;
    if (isFocused) current.focus({ preventScroll: true });
  }

  /**
   * @param {number} object
   * @param {number} keypoint
   * @param {number} width
   */
  #cell(object, keypoint, width) {
    const cell = h("div", {
      role: "gridcell",
      class: "matrix-cell",
      tabIndex: -1,
      "aria-label": describe(this.#session, object, keypoint),
      "aria-selected": String(this.#session.score.keypointOf(object) === keypoint),
      data: { object, keypoint },
    });
    cell.style.width = `${width}px`;
    return cell;
  }

  /** @param {HTMLElement} layer */
  listen(layer) {
    layer.addEventListener("click", (event) => {
      const cell = cellOf(event);
      if (cell) this.#choose(cell);
    });
    layer.addEventListener("keydown", (event) => {
      const cell = cellOf(event);
      if (!cell || event.ctrlKey || event.altKey || event.metaKey) return;
      if (event.key === "Enter" || event.key === " ") this.#choose(cell);
      else {
        const next = this.#neighbour(positionOf(cell), event.key);
        if (!next) return;
        this.#move(next);
      }
      event.preventDefault();
    });
  }

  /**
   * Where a key leads to, which may be outside; `null` for other keys.
   * @param {{ object: number, keypoint: number }} from
   * @param {string} key
   */
  #neighbour({ object, keypoint }, key) {
    if (key === "Home") return { object, keypoint: 0 };
    if (key === "End") return { object, keypoint: this.cells[0].length - 1 };
    if (!(key in STEPS)) return null;
    const [down, right] = STEPS[key];
    return { object: object + down, keypoint: keypoint + right };
  }

  /** @param {{ object: number, keypoint: number }} next */
  #move(next) {
    const target = this.cells[next.object]?.[next.keypoint];
    if (!target) return;
    this.cells[this.#at.object][this.#at.keypoint].tabIndex = -1;
    this.#at = next;
    target.tabIndex = 0;
    target.focus();
  }

  /** @param {HTMLElement} cell */
  #choose(cell) {
    this.#at = positionOf(cell);
    choose(this.#session, this.#at.object, this.#at.keypoint);
  }
}

/**
 * Shows an object with a keypoint.
 * @param {Session} session
 * @param {number} object
 * @param {number} keypoint
 */
function choose({ score }, object, keypoint) {
  const best = score.evaluation?.objects[object].best_keypoint;
  // Of a saved evaluation there is nothing else to show with another keypoint.
  if (best === null || best === undefined || !score.scoring) return;
  score.choose(object, keypoint === best ? null : keypoint);
  byId("stage").scrollIntoView({ block: "nearest" });
}

/**
 * Describes the cell under the pointer or with the focus.
 * @param {Session} session
 * @param {import("./figure.js").FigureView} figure
 * @param {Grid} grid
 */
function showTips(session, figure, grid) {
  const tell = (/** @type {Event} */ event) => {
    const cell = cellOf(event);
    const drawn = figure.drawing();
    if (!cell || !drawn) return figure.showTip(null);
    const { object, keypoint } = positionOf(cell);
    const [left, top, width, height] = drawn.plot;
    const x = left + ((keypoint + 0.5) * width) / grid.cells[0].length;
    const y = top + ((object + 1) * height) / grid.cells.length;
    figure.showTip(describe(session, object, keypoint), x, y);
  };
  figure.layer.addEventListener("pointerover", tell);
  figure.layer.addEventListener("pointerleave", () => figure.showTip(null));
  figure.layer.addEventListener("focusin", tell);
  figure.layer.addEventListener("focusout", () => figure.showTip(null));
}

/** @param {Event} event */
function cellOf({ target }) {
  return target instanceof HTMLElement && target.dataset.keypoint !== undefined ? target : null;
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
      ? "within the threshold"
      : `${significant(error / result.threshold)} × the threshold`,
    keypoint === result.best_keypoint && "best",
    session.score.keypointOf(object) === keypoint && "on display",
  ];
  return `${what}: error ${significant(error)}, ${notes.filter(Boolean).join(", ")}`;
}
