// @ts-check
/**
 * The frames of a sequence with the object, a keypoint and the keypoint under the fitted map, next
 * to their plots.
 */

import { byId, fill, h } from "../ui/dom.js";
import { keysView, listenToKeys } from "../ui/keys.js";
import { objectColor } from "../ui/palette.js";
import { legend } from "./legend.js";
import { liveliest } from "./liveliest.js";
import { TRAILS, keepLook, loadLook } from "./look.js";
import { pickers } from "./pickers.js";
import { plots } from "./plots.js";
import { SequenceList } from "./sequences.js";
import { Stage } from "./stage.js";
import { transport } from "./transport.js";
import { zoomView } from "./zoom-view.js";

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
const IN_SPACE =
  "The ground truth is in space: its coordinates are plotted. A camera (camera.json) puts it into " +
  "the frames.";
const WHEEL = "The wheel zooms once the image was clicked. A click selects a keypoint.";

/** @param {Session} session */
export function showViewer(session) {
  const place = byId("viewer");
  const { score } = session;
  const look = loadLook();
  const note = h("p", { class: "viewer-note" });
  const inSpace = h("p", { class: "viewer-note" }, IN_SPACE);
  const problem = h("p", { class: "viewer-note", role: "status" });
  const view = new Stage(session, look, (message) => (problem.textContent = message));
  const moving = transport(
    session,
    (frame) => view.prepare(frame),
    look,
    () => keepLook(look),
  );
  const { player } = moving;
  const sequences = new SequenceList(session, (range) => player.show(range));
  const picking = pickers(session);
  const redraw = () => {
    keepLook(look);
    view.draw();
  };
  const layers = legend(session, look, () => {
    problem.textContent = "";
    redraw();
  });
  const trails = h("label", { class: "field" }, h("span", {}, "Trails"), trailSelect(look, redraw));
  const tools = h("div", { class: "viewer-tools" }, trails, moving.speedField);
  const shown = [view.element, inSpace, moving.element, layers.element];
  const frames = [...shown, problem, sequences.element];
  const beside = besideView(session, picking.elements);
  const zoom = zoomView(view.gesture);
  fill(place, framesView(zoom, frames, [tools, note]), beside);
  listenToKeys(place, (event) => player.key(event) || view.gesture.key(event.key));

  const showSelection = () => {
    place.hidden = !score.shown || (score.points !== null && !score.evaluation);
    if (place.hidden) return;
    for (const part of [picking, moving, sequences]) part.update();
    view.draw();
  };
  const showPair = () => {
    const { object } = score.selection;
    if (!score.shown) return;
    beside.hidden = score.objects.length === 0;
    picking.updateKeypoints();
    layers.update(score.objects[object] ?? "object", score.keypointOf(object), objectColor(object));
    note.textContent = placingNote(session);
    inSpace.hidden = !score.isInSpace;
    // Nothing of space is seen on an empty plate.
    const isEmpty = score.isInSpace && !score.hasPictures;
    for (const part of [view.element, layers.element, zoom]) part.hidden = isEmpty;
  };
  const open = opener(session, player);
  score.addEventListener("preview", () => {
    picking.rebuild();
    open();
    view.renew();
    showSelection();
    showPair();
  });
  follow(session, showSelection, showPair, () => {
    view.reset();
    problem.textContent = "";
    picking.rebuild();
    open();
  });
}

/**
 * @param {HTMLElement} zoom
 * @param {HTMLElement[]} frames
 * @param {HTMLElement[]} tools
 */
function framesView(zoom, frames, tools) {
  const title = h("h2", { id: "viewer-title" }, "Frames");
  const head = h("div", { class: "viewer-head" }, title, zoom);
  const summary = h("summary", {}, "Trails, speed, keys");
  const more = h(
    "details",
    { class: "keys" },
    summary,
    ...tools,
    keysView(KEYS),
    h("p", {}, WHEEL),
  );
  return h("div", { class: "panel viewer-stage" }, head, ...frames, more);
}

/**
 * The plots, and what they are of.
 * @param {Session} session
 * @param {HTMLElement[]} pickers
 */
function besideView(session, pickers) {
  const { elements, zoom } = plots(session);
  return h(
    "div",
    { class: "panel viewer-plots" },
    h("div", { class: "viewer-head" }, ...pickers, zoom),
    h("div", { class: "viewer-lines" }, ...elements),
  );
}

/**
 * Opens other frames where most happens, and plays them for those who do not mind.
 * @param {Session} session
 * @param {import("./player.js").Player} player
 */
function opener(session, player) {
  const { score } = session;
  let shown = "";
  return () => {
    // Ground truth that comes later says where that is.
    const next = JSON.stringify([score.sequences, score.objects]);
    if (next === shown) return;
    shown = next;
    player.play(false);
    const sequence = liveliest(session);
    if (!sequence) return;
    player.show(sequence);
    player.play(!window.matchMedia("(prefers-reduced-motion: reduce)").matches);
  };
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
  if (!score.scoring) return "Keypoints appear as they are extracted.";
  if (score.keypointOf(score.selection.object) === null) {
    return "This object is visible in no frame, so no keypoint is fitted to it.";
  }
  if (score.axes[0] === 3) return "Keypoints in space are drawn where the map puts them.";
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
