// @ts-check
/** The buttons that zoom a canvas. */

import { h, icon } from "../ui/dom.js";

/** @param {import("./gestures.js").Gestures} gesture */
export function zoomView(gesture) {
  const button = (
    /** @type {string} */ symbol,
    /** @type {string} */ label,
    /** @type {() => void} */ onclick,
  ) =>
    h(
      "button",
      { type: "button", class: "button round", "aria-label": label, title: label, onclick },
      icon(symbol),
    );
  return h(
    "div",
    { class: "zoom", role: "group", "aria-label": "Zoom" },
    button("icon-none", "Zoom out (−)", () => gesture.zoomOut()),
    button("icon-plus", "Zoom in (+)", () => gesture.zoomIn()),
    button("icon-fit", "All of the image (0)", () => gesture.reset()),
  );
}
