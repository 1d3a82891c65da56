// @ts-check
/** The layers of a frame, each with a button that shows or hides it. */

import { h, icon } from "../ui/dom.js";
import { Inside } from "./inside.js";
import { LAYERS } from "./look.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./look.js").Look} Look
 * @typedef {import("./scene.js").Layer} Layer
 */

/**
 * @param {Session} session
 * @param {Look} look
 * @param {() => void} onChange
 */
export function legend(session, look, onChange) {
  const layers = new Map(LAYERS.map(([layer, label]) => [layer, layerView(layer, label)]));

  /**
   * @param {Layer} layer
   * @param {string} label
   */
  function layerView(layer, label) {
    const text = h("span", {}, label);
    const button = h(
      "button",
      {
        type: "button",
        class: "layer",
        data: { mark: layer },
        "aria-pressed": String(look.layers.has(layer)),
        onclick: () => {
          if (!look.layers.delete(layer)) look.layers.add(layer);
          button.setAttribute("aria-pressed", String(look.layers.has(layer)));
          onChange();
        },
      },
      icon(`mark-${layer}`, "mark"),
      text,
    );
    return { button, text };
  }

  /**
   * Names the layers after what is on display.
   * @param {string} object
   * @param {number | null} keypoint
   * @param {string} color of the object
   */
  const update = (object, keypoint, color) => {
    /** @type {[Layer, string][]} */
    const names = [
      ["truth", `${object}, ground truth`],
      ["keypoint", keypoint === null ? "keypoint" : `keypoint ${keypoint}`],
      [
        "transformed",
        keypoint === null ? "mapped" : `keypoint ${keypoint}, mapped`,
      ],
    ];
    for (const [layer, name] of names) {
      const view = layers.get(layer);
      if (!view) continue;
      view.text.textContent = name;
      view.button.style.setProperty("--mark", color);
    }
    /** @type {[Layer, boolean][]} */
    const offers = [
      ["heat", Inside.hasHeat(session)],
      ["image", Inside.hasImage(session)],
    ];
    for (const [layer, isPossible] of offers) {
      const view = layers.get(layer);
      if (view) view.button.hidden = !isPossible;
    }
  };
  const element = h(
    "ul",
    { class: "legend", "aria-label": "Shown in the frame" },
    ...Array.from(layers.values(), ({ button }) => h("li", {}, button)),
  );
  return { element, update };
}
