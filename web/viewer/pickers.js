// @ts-check
/** The choice of the object and its keypoint on display. */

import { fill, h } from "../ui/dom.js";
import { significant } from "../ui/format.js";

/** @typedef {import("../session.js").Session} Session */

/** @param {Session} session */
export function pickers({ score }) {
  const objects = h("select", {
    id: "viewer-object",
    onchange: () => score.select({ object: objects.selectedIndex }),
  });
  const keypoints = h("select", {
    id: "viewer-keypoint",
    onchange: () => {
      const chosen = keypoints.value === "" ? null : Number(keypoints.value);
      score.choose(score.selection.object, chosen);
    },
  });
  const field = (/** @type {string} */ label, /** @type {HTMLElement} */ select) =>
    h("label", { class: "field" }, h("span", {}, label), select);

  /** Other objects came. */
  const rebuild = () => fill(objects, ...score.objects.map((name) => h("option", {}, name)));
  const update = () => {
    objects.selectedIndex = score.selection.object;
  };
  /** The keypoints of the object on display. */
  const updateKeypoints = () => {
    const { object } = score.selection;
    const best = score.judged?.objects[object]?.best_keypoint ?? null;
    const errors = score.judged?.errors[object] ?? [];
    fill(
      keypoints,
      h("option", { value: "" }, best === null ? "none" : `best (no. ${best})`),
      ...errors.map((error, n) =>
        h("option", { value: String(n) }, `no. ${n} · error ${significant(error)}`),
      ),
    );
    const keypoint = score.keypointOf(object);
    keypoints.value = keypoint === best ? "" : String(keypoint);
  };
  const elements = [field("Object", objects), field("Keypoint", keypoints)];
  return { elements, rebuild, update, updateKeypoints };
}
