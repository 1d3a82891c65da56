// @ts-check
/**
 * The frames of a sequence with the object, a keypoint and the keypoint under the fitted map,
 * beside their plots.
 */

import { byId, fill, h, icon } from "../ui/dom.js";
import { significant } from "../ui/format.js";
import { load, store } from "../settings.js";
import { Inside } from "./inside.js";
import { plots } from "./plots.js";
import { sequenceList } from "./sequences.js";
import { stage } from "./stage.js";
import { transport } from "./transport.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./scene.js").Layer} Layer
 */

/** Frames that a trail reaches back. @type {[number, string][]} */
const TRAILS = [
  [5, "5 frames"],
  [10, "10 frames"],
  [25, "25 frames"],
  [100, "100 frames"],
  [Infinity, "from the start"],
];

/** @type {[Layer, string][]} */
const LAYERS = [
  ["truth", "ground truth"],
  ["keypoint", "keypoint"],
  ["transformed", "under the fitted map"],
  ["keypoints", "all keypoints"],
  ["trails", "trails"],
  ["heat", "heat map"],
  ["image", "reconstruction"],
];

const KEYS = [
  ["Space", "play or pause"],
  ["← →", "one frame, ten with Shift"],
  ["Home End", "first and last frame"],
  ["Page ↑ ↓", "sequence before, next sequence"],
  ["+ − 0", "zoom in, zoom out, all of the image"],
  ["W A S D", "move the zoomed image"],
];

/** @param {Session} session */
export function showViewer(session) {
  const place = byId("viewer");
  const settings = loadSettings();
  const keep = () =>
    store("viewer", {
      layers: [...settings.layers],
      trail: Number.isFinite(settings.trail) ? settings.trail : null,
      speed: settings.speed,
    });

  const note = h("p", { class: "viewer-note" });
  const problem = h("p", { class: "viewer-note", role: "status" });
  const view = stage(session, settings, (message) => (problem.textContent = message));
  const moving = transport(session, view.prepare, settings, keep);
  const sequences = sequenceList(session);

  const objects = h("select", {
    id: "viewer-object",
    onchange: () => session.score.select({ object: objects.selectedIndex }),
  });
  const keypoints = h("select", {
    id: "viewer-keypoint",
    onchange: () =>
      session.score.choose(
        session.score.selection.object,
        keypoints.value === "" ? null : Number(keypoints.value),
      ),
  });
  const trail = h(
    "select",
    {
      id: "trail",
      onchange: () => {
        settings.trail = TRAILS[trail.selectedIndex][0];
        keep();
        view.draw();
      },
    },
    ...TRAILS.map(([frames, label]) => h("option", { selected: frames === settings.trail }, label)),
  );
  const layers = new Map(
    LAYERS.map(([layer, label]) => {
      const text = h("span", {}, label);
      const button = h(
        "button",
        {
          type: "button",
          class: "layer",
          data: { mark: layer },
          "aria-pressed": String(settings.layers.has(layer)),
          onclick: () => {
            if (!settings.layers.delete(layer)) settings.layers.add(layer);
            button.setAttribute("aria-pressed", String(settings.layers.has(layer)));
            problem.textContent = "";
            keep();
            view.draw();
          },
        },
        icon(`mark-${layer}`, "mark"),
        text,
      );
      return [layer, { button, text }];
    }),
  );
  const zoomButton = (
    /** @type {string} */ symbol,
    /** @type {string} */ label,
    /** @type {() => void} */ onclick,
  ) =>
    h(
      "button",
      { type: "button", class: "button round", "aria-label": label, title: label, onclick },
      icon(symbol),
    );

  fill(
    place,
    h(
      "div",
      { class: "viewer-head" },
      h("h2", { id: "viewer-title" }, "Frames and trajectories"),
      h("label", { class: "field" }, h("span", {}, "Object"), objects),
      h("label", { class: "field" }, h("span", {}, "Keypoint"), keypoints),
    ),
    h(
      "div",
      { class: "viewer-body" },
      h(
        "div",
        { class: "viewer-stage" },
        view.element,
        moving.element,
        h(
          "div",
          { class: "viewer-tools" },
          h(
            "div",
            { class: "zoom", role: "group", "aria-label": "Zoom" },
            zoomButton("icon-none", "Zoom out (−)", view.gesture.zoomOut),
            zoomButton("icon-plus", "Zoom in (+)", view.gesture.zoomIn),
            zoomButton("icon-fit", "All of the image (0)", view.gesture.reset),
          ),
          h("label", { class: "field" }, h("span", {}, "Trails"), trail),
          moving.speedField,
        ),
        h(
          "ul",
          { class: "legend", "aria-label": "Shown in the frame" },
          ...Array.from(layers.values(), ({ button }) => h("li", {}, button)),
        ),
        note,
        problem,
        h(
          "details",
          { class: "keys" },
          h("summary", {}, "Keys"),
          h(
            "dl",
            {},
            ...KEYS.map(([keys, what]) => h("div", {}, h("dt", {}, keys), h("dd", {}, what))),
          ),
          h(
            "p",
            {},
            "The wheel zooms once the image was clicked; a keypoint is selected by a click.",
          ),
        ),
      ),
      h("div", { class: "viewer-plots" }, ...plots(session)),
      sequences.element,
    ),
  );

  place.addEventListener("keydown", (event) => {
    const { target, key } = event;
    if (event.ctrlKey || event.altKey || event.metaKey || target instanceof HTMLSelectElement)
      return;
    if (target instanceof HTMLInputElement && target.type !== "range") return;
    const presses =
      target instanceof HTMLButtonElement ||
      (target instanceof HTMLElement && target.tagName === "SUMMARY");
    if (presses && key === " ") return;
    if (moving.key(event) || view.gesture.key(key)) event.preventDefault();
  });

  // Following the session

  const showSelection = () => {
    place.hidden = session.score.evaluation === null || session.score.scoring === null;
    if (place.hidden) return;
    objects.selectedIndex = session.score.selection.object;
    moving.update();
    sequences.update();
    view.draw();
  };
  /** What belongs to the object and the keypoint on display. */
  const showPair = () => {
    const result =
      session.score.scoring && session.score.evaluation?.objects[session.score.selection.object];
    if (!result) return;
    const errors = session.score.evaluation?.errors[session.score.selection.object] ?? [];
    const best = result.best_keypoint === null ? "none" : `best (no. ${result.best_keypoint})`;
    fill(
      keypoints,
      h("option", { value: "" }, best),
      ...errors.map((error, n) =>
        h("option", { value: String(n) }, `no. ${n} · error ${significant(error)}`),
      ),
    );
    const keypoint = session.score.keypointOf(session.score.selection.object);
    keypoints.value = keypoint === result.best_keypoint ? "" : String(keypoint);
    const name = (/** @type {Layer} */ layer, /** @type {string} */ text) => {
      /** @type {{ text: HTMLElement }} */ (layers.get(layer)).text.textContent = text;
    };
    name("truth", `${result.name}, ground truth`);
    name("keypoint", keypoint === null ? "keypoint" : `keypoint ${keypoint}`);
    name(
      "transformed",
      keypoint === null ? "under the fitted map" : `keypoint ${keypoint} under the fitted map`,
    );
    const offer = (/** @type {Layer} */ layer, /** @type {boolean} */ possible) => {
      /** @type {{ button: HTMLElement }} */ (layers.get(layer)).button.hidden = !possible;
    };
    offer("heat", Inside.hasHeat(session));
    offer("image", Inside.hasImage(session));
    note.textContent =
      result.best_keypoint === null
        ? "This object is visible in no frame, so no keypoint is fitted to it."
        : session.score.placesKeypoints
          ? "Keypoints are drawn where the grid of the encoder places them in the image."
          : "Keypoints are drawn as given, taken as image coordinates (ndc).";
  };

  let pair = "";
  session.score.addEventListener("scoring", () => {
    moving.pause();
    view.reset();
    problem.textContent = "";
    fill(objects, ...session.score.objects.map((name) => h("option", {}, name)));
    showSelection();
    showPair();
  });
  session.score.addEventListener("evaluation", () => {
    showSelection();
    showPair();
  });
  session.score.addEventListener("selection", () => {
    showSelection();
    const next =
      `${session.score.selection.object} ` +
      `${session.score.keypointOf(session.score.selection.object)}`;
    if (next !== pair) showPair();
    pair = next;
  });
}

/** What was set the last time, as far as it is understood. */
function loadSettings() {
  const stored = load("viewer");
  const names = LAYERS.map(([layer]) => layer);
  const kept = Array.isArray(stored.layers)
    ? names.filter((layer) => stored.layers.includes(layer))
    : null;
  const lengths = TRAILS.map(([frames]) => frames);
  const trail = stored.trail === null ? Infinity : stored.trail;
  return {
    layers: new Set(kept ?? names.filter((layer) => layer !== "heat" && layer !== "image")),
    trail: lengths.includes(trail) ? trail : 25,
    speed: stored.speed > 0 && stored.speed <= 240 ? Number(stored.speed) : 5,
  };
}
