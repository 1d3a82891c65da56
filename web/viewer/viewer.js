// @ts-check
/**
 * The frames of a sequence with the object, a keypoint and the keypoint under the fitted map, next
 * to their plots.
 */

import { byId, fill, h, icon } from "../ui/dom.js";
import { legend } from "./legend.js";
import { TRAILS, keepLook, loadLook } from "./look.js";
import { pickers } from "./pickers.js";
import { plots } from "./plots.js";
import { sequenceList } from "./sequences.js";
import { Stage } from "./stage.js";
import { transport } from "./transport.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./look.js").Look} Look
 */

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
  const { score } = session;
  const look = loadLook();
  const note = h("p", { class: "viewer-note" });
  const problem = h("p", { class: "viewer-note", role: "status" });
  const view = new Stage(session, look, (message) => (problem.textContent = message));
  const moving = transport(
    session,
    (frame) => view.prepare(frame),
    look,
    () => keepLook(look),
  );
  const sequences = sequenceList(session);
  const picking = pickers(session);
  const redraw = () => {
    keepLook(look);
    view.draw();
  };
  const layers = legend(session, look, () => {
    problem.textContent = "";
    redraw();
  });
  const tools = h(
    "div",
    { class: "viewer-tools" },
    zoomView(view.gesture),
    h("label", { class: "field" }, h("span", {}, "Trails"), trailSelect(look, redraw)),
    moving.speedField,
  );
  const title = h("h2", { id: "viewer-title" }, "Frames and trajectories");
  const shown = [view.element, moving.element, tools, layers.element, note, problem, keysView()];
  fill(
    place,
    h("div", { class: "viewer-head" }, title, ...picking.elements),
    h(
      "div",
      { class: "viewer-body" },
      h("div", { class: "viewer-stage" }, ...shown),
      h("div", { class: "viewer-plots" }, ...plots(session)),
      sequences.element,
    ),
  );
  listenToKeys(place, (event) => moving.key(event) || view.gesture.key(event.key));

  const showSelection = () => {
    place.hidden = score.evaluation === null || score.scoring === null;
    if (place.hidden) return;
    for (const part of [picking, moving, sequences]) part.update();
    view.draw();
  };
  const showPair = () => {
    const { object } = score.selection;
    if (!score.scoring || !score.evaluation?.objects[object]) return;
    picking.updateKeypoints();
    layers.update(score.objects[object], score.keypointOf(object));
    note.textContent = placingNote(session);
  };
  follow(session, showSelection, showPair, () => {
    moving.pause();
    view.reset();
    problem.textContent = "";
    picking.rebuild();
  });
}

/**
 * Follows the score.
 * @param {Session} session
 * @param {() => void} showSelection
 * @param {() => void} showPair shows what belongs to the object and the keypoint on display
 * @param {() => void} reset
 */
function follow({ score }, showSelection, showPair, reset) {
  let pair = "";
  const showAll = () => {
    showSelection();
    showPair();
  };
  score.addEventListener("scoring", () => {
    reset();
    showAll();
  });
  score.addEventListener("evaluation", showAll);
  score.addEventListener("selection", () => {
    showSelection();
    const { object } = score.selection;
    const next = `${object} ${score.keypointOf(object)}`;
    if (next !== pair) showPair();
    pair = next;
  });
}

/**
 * Where keypoints are drawn.
 * @param {Session} session
 */
function placingNote({ score }) {
  if (score.keypointOf(score.selection.object) === null) {
    return "This object is visible in no frame, so no keypoint is fitted to it.";
  }
  return score.placesKeypoints
    ? "Keypoints are drawn where the grid of the encoder places them in the image."
    : "Keypoints are drawn as given, taken as image coordinates (ndc).";
}

/**
 * @param {Look} look
 * @param {() => void} onChange
 */
function trailSelect(look, onChange) {
  const trail = h(
    "select",
    {
      id: "trail",
      onchange: () => {
        look.trail = TRAILS[trail.selectedIndex][0];
        onChange();
      },
    },
    ...TRAILS.map(([frames, label]) => h("option", { selected: frames === look.trail }, label)),
  );
  return trail;
}

/** @param {{ zoomIn: () => void, zoomOut: () => void, reset: () => void }} gesture */
function zoomView({ zoomIn, zoomOut, reset }) {
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
    button("icon-none", "Zoom out (−)", zoomOut),
    button("icon-plus", "Zoom in (+)", zoomIn),
    button("icon-fit", "All of the image (0)", reset),
  );
}

function keysView() {
  const rows = KEYS.map(([keys, what]) => h("div", {}, h("dt", {}, keys), h("dd", {}, what)));
  return h(
    "details",
    { class: "keys" },
    h("summary", {}, "Keys"),
    h("dl", {}, ...rows),
    h("p", {}, "The wheel zooms once the image was clicked. A click selects a keypoint."),
  );
}

/**
 * Listens to keys that no control takes.
 * @param {HTMLElement} place
 * @param {(event: KeyboardEvent) => boolean} take whether the key was one of those known
 */
function listenToKeys(place, take) {
  place.addEventListener("keydown", (event) => {
    const { target, key } = event;
    const isModified = event.ctrlKey || event.altKey || event.metaKey;
    if (isModified || target instanceof HTMLSelectElement) return;
    if (target instanceof HTMLInputElement && target.type !== "range") return;
    const presses =
      target instanceof HTMLButtonElement ||
      (target instanceof HTMLElement && target.tagName === "SUMMARY");
    if (presses && key === " ") return;
    if (take(event)) event.preventDefault();
  });
}
