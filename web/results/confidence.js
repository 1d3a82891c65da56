// @ts-check
/**
 * How sure points have to be to count: the smallest confidences, and the TC as a function of the
 * keypoints' one. For tables that have confidences.
 */

import { confidenceFigure } from "../pkg/index.js";
import { h } from "../ui/dom.js";
import { count } from "../ui/format.js";
import { figureView } from "./figure.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../pkg/index.js").MinConfidence} MinConfidence
 */

/**
 * @param {Session} session
 * @returns {{ element: HTMLElement, update: () => void } | null} `null` where nothing has a
 * confidence
 */
export function confidenceView(session) {
  const { score, confident } = session;
  if (!score.scoring || !(confident.keypoints || confident.truth)) return null;
  const figure = figureView({
    id: "confidence",
    label: "Tracking capability over the smallest confidence that counts",
    draw: (theme, width) =>
      score.evaluation?.confidence?.levels.length
        ? confidenceFigure(score.evaluation, theme, width)
        : null,
  });
  const told = h("p", { class: "hint-line", role: "status" });
  const element = h(
    "section",
    { class: "panel", "aria-labelledby": "confidence-title" },
    h("h3", { id: "confidence-title" }, "Confidence"),
    h(
      "p",
      { class: "hint-line" },
      "Points below the smallest confidence count as missing. The dashed line is the share of the " +
        "keypoints that is left.",
    ),
    h(
      "div",
      { class: "settings" },
      confident.keypoints && field(session, "keypoints", "Keypoints from"),
      confident.truth && field(session, "truth", "Ground truth from"),
    ),
    told,
    confident.keypoints && figure.element,
  );
  const update = () => {
    const { hidden_keypoints: keypoints, hidden_truth: truth } = score.evaluation?.confidence ?? {};
    told.textContent = [
      keypoints != null && `${count(keypoints, "keypoint")} count as missing.`,
      truth != null && `${count(truth, "position")} of the ground truth count as not visible.`,
    ]
      .filter(Boolean)
      .join(" ");
    if (confident.keypoints) figure.update();
  };
  return { element, update };
}

/**
 * @param {Session} session
 * @param {keyof MinConfidence} whose
 * @param {string} label
 */
function field(session, whose, label) {
  const input = h("input", {
    type: "number",
    id: `min-confidence-${whose}`,
    step: "any",
    placeholder: "any",
    value: String(session.minConfidence[whose] ?? ""),
    onchange: () => {
      const isEmpty = input.value === "" && !input.validity.badInput;
      const value = input.valueAsNumber;
      input.setAttribute("aria-invalid", String(!isEmpty && !Number.isFinite(value)));
      if (isEmpty) void session.setMinConfidence({ [whose]: undefined });
      else if (Number.isFinite(value)) void session.setMinConfidence({ [whose]: value });
    },
  });
  return h("label", { class: "field" }, h("span", {}, label), input);
}
