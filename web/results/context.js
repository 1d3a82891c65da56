// @ts-check
/** Metrics of other authors, computed when they are looked at. */

import { fill, h } from "../ui/dom.js";
import { fixed, integer, significant } from "../ui/format.js";
import { scrollRegion } from "../ui/scroll-region.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../pkg/index.js").Context} Context
 */

/** @param {Session} session */
export function contextView(session) {
  const body = h("div", { class: "context-body" });
  /** What the tables are of. */
  let key = "";
  const element = h(
    "details",
    { class: "panel context", id: "context", ontoggle: () => update() },
    h("summary", {}, h("h3", {}, "Other metrics"), " regression with PCK, min-cost assignment"),
    body,
  );
  const update = () => {
    if (!element.open) return;
    // Neither the map nor the thresholds matter here.
    const now = `${session.score.evaluation?.frames} ${session.score.folds}`;
    if (now === key) return;
    key = now;
    const context = session.score.context();
    fill(body, ...(context ? tables(context) : [h("p", {}, "The saved evaluation has none.")]));
  };
  return { element, update };
}

/** @param {Context} context */
function tables(context) {
  const within = context.close.map((share) => `within ${percent(share)}`);
  const pck = (/** @type {number[] | null} */ shares) =>
    context.close.map((_, i) => (shares ? percent(shares[i]) : "–"));
  return [
    h(
      "p",
      { class: "hint-line" },
      "Every object predicted from all keypoints together by linear regression, and the " +
        "percentage of correct positions (PCK) " +
        "within a share of the side of the image (T. Jakab et al., 2018; their 6 of 128 pixels " +
        "is the middle one). It asks whether " +
        "the position is somewhere in the keypoints, not whether one of them follows the object.",
    ),
    table(
      ["object", "frames", "error", ...within],
      context.regression.map(({ object, held_out: heldOut, frames, error, pck: shares }) => [
        object,
        `${integer(frames)} ${heldOut ? "held out" : "fitted"}`,
        significant(error),
        ...pck(shares),
      ]),
    ),
    h(
      "p",
      { class: "hint-line" },
      "Keypoints as they are, matched one to one to the objects with the smallest total distance " +
        "(T. Kulkarni et al., 2019): precision " +
        "is the share of keypoints that are matched that closely, recall that of objects; anew " +
        "in every frame, or once a sequence.",
    ),
    table(
      ["matched", "", ...within],
      context.assignment.flatMap(({ trajectory, precision, recall }) => [
        [`once a ${trajectory}`, "precision", ...pck(precision)],
        [`once a ${trajectory}`, "recall", ...pck(recall)],
      ]),
    ),
  ];
}

/**
 * @param {string[]} head
 * @param {string[][]} rows
 */
function table(head, rows) {
  const element = h(
    "table",
    {},
    h(
      "thead",
      {},
      h("tr", {}, ...head.map((text) => (text ? h("th", { scope: "col" }, text) : h("td")))),
    ),
    h(
      "tbody",
      {},
      ...rows.map(([first, ...rest]) =>
        h("tr", {}, h("th", { scope: "row" }, first), ...rest.map((text) => h("td", {}, text))),
      ),
    ),
  );
  return scrollRegion(
    h("div", { class: "table-scroll" }, element),
    head.filter(Boolean).join(", "),
  );
}

/** @param {number} share */
function percent(share) {
  return `${fixed(100 * share, 1)} %`;
}
