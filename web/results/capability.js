// @ts-check
/** TC over a common factor of all thresholds, with a slider that reads it off. */

import { capabilityFigure } from "../pkg/index.js";
import { h } from "../ui/dom.js";
import { fixed, significant } from "../ui/format.js";
import { figureView } from "./figure.js";

/** @typedef {import("../session.js").Session} Session */

/** The slider goes over the axis in so many steps. */
const STEPS = 400;

/** @param {Session} session */
export function capabilityView(session) {
  let factor = 1;
  /** The ends of the axis. @type {[number, number]} */
  let range = [0.1, 10];
  const readout = h("output", { class: "factor-readout", for: "factor" });
  const slider = h("input", {
    type: "range",
    id: "factor",
    min: "0",
    max: String(STEPS),
    step: "1",
    oninput: () => {
      const share = Number(slider.value) / STEPS;
      factor = range[0] * (range[1] / range[0]) ** share;
      // The slider comes to rest at the thresholds as they are.
      if (Math.abs(Math.log(factor)) < (0.75 * Math.log(range[1] / range[0])) / STEPS) factor = 1;
      tell();
      figure.update();
    },
  });
  const figure = figureView({
    id: "capability",
    label: "Tracking capability over a common factor of all thresholds",
    draw: (theme, width) =>
      session.score.evaluation
        ? capabilityFigure(session.score.evaluation, theme ? factor : undefined, theme, width)
        : null,
    drawn: (drawn) => {
      range = drawn.x;
      slider.value = String(
        Math.round((STEPS * Math.log(factor / range[0])) / Math.log(range[1] / range[0])),
      );
      tell();
    },
  });

  const read = (/** @type {number} */ at) => {
    const objects = session.score.evaluation?.objects ?? [];
    const tracked = objects.filter(
      ({ error, threshold }) => error !== null && error <= at * threshold,
    );
    const names = tracked.length > 0 ? tracked.map(({ name }) => name).join(", ") : "none";
    return { tc: tracked.length / Math.max(1, objects.length), names };
  };
  const tell = () => {
    const { tc, names } = read(factor);
    const text = `× ${significant(factor)}: TC ${fixed(tc)} (${names})`;
    readout.textContent = text;
    slider.setAttribute("aria-valuetext", text);
  };
  figure.layer.addEventListener("pointermove", (event) => {
    const drawn = figure.drawing();
    if (!drawn) return;
    const [left, top, width] = drawn.plot;
    const share = (event.clientX - figure.layer.getBoundingClientRect().left - left) / width;
    if (share < 0 || share > 1) return figure.showTip(null);
    const at = drawn.x[0] * (drawn.x[1] / drawn.x[0]) ** share;
    const { tc, names } = read(at);
    figure.showTip(`× ${significant(at)}: TC ${fixed(tc)} (${names})`, left + share * width, top);
  });
  figure.layer.addEventListener("pointerleave", () => figure.showTip(null));

  const element = h(
    "section",
    { class: "panel", "aria-labelledby": "capability-title" },
    h("h3", { id: "capability-title" }, "Sensitivity to thresholds"),
    h(
      "p",
      { class: "hint-line" },
      "All thresholds times a common factor. An object joins at its error divided by its " +
        "threshold.",
    ),
    figure.element,
    h("div", { class: "factor" }, h("label", { for: "factor" }, "Factor"), slider, readout),
  );
  return { element, update: figure.update };
}
