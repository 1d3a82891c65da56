// @ts-check
/**
 * The results: tracking capability and the objects; in tabs the figures, other metrics, and the
 * export.
 */

import { announce, byId, fill, h } from "../ui/dom.js";
import { capabilityView } from "./capability.js";
import { card } from "./cards.js";
import { confidenceView } from "./confidence.js";
import { contextView } from "./context.js";
import { exportView } from "./export.js";
import { matrixView } from "./matrix.js";
import { objectTable } from "./object-table.js";
import { SequencesView } from "./sequences.js";
import { setAvailable } from "../ui/tabs.js";
import { summaryView, tally, tcText } from "./summary.js";
import { trajectoriesView } from "../viewer/trajectories.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {{ element: HTMLElement, update: () => void }} View
 */

/** More objects than these are shown in a table. */
const MOST_CARDS = 6;

/** The panels of the tabs that are filled here. */
const TABS = [
  "view-matrix",
  "view-trajectories",
  "view-sequences",
  "view-thresholds",
  "view-export",
];

/** @param {Session} session */
export function showResults(session) {
  const place = byId("results");
  /** What follows the evaluation. @type {View[]} */
  let views = [];
  /** @type {View[]} */
  let cards = [];
  /** @type {View | null} */
  let matrix = null;
  /** @type {View | null} */
  let sequences = null;
  /** @type {View | null} */
  let trajectories = null;
  /** What the cards and the sequences were last shown for. */
  let shown = "";

  const rebuild = () => {
    const wasShown = views.length > 0;
    views = [];
    if (!session.score.evaluation) {
      place.hidden = true;
      fill(place);
      fillTabs(TABS.map(() => []));
      delete place.dataset.tc;
      if (wasShown) announce("There is no score any more.");
      return;
    }
    const summary = summaryView(session);
    cards = objectViews(session);
    matrix = matrixView(session);
    const capability = capabilityView(session);
    sequences = new SequencesView(session);
    trajectories = session.score.scoring ? trajectoriesView(session) : null;
    const confidence = confidenceView(session);
    const context = contextView(session);
    const taking = exportView(session);
    const tabs = [matrix, trajectories, capability, confidence, sequences, context, taking];
    views = [summary, ...cards, ...tabs.filter((view) => view !== null)];
    const lists = cards.map(({ element }) => element);
    fill(place, summary.element, h("div", { class: "objects panel" }, ...lists, summary.warnings));
    fillTabs([
      [matrix.element],
      trajectories ? [trajectories.element] : [],
      [sequences.element],
      [capability.element, ...(confidence ? [confidence.element] : []), context.element],
      [taking.element],
    ]);
    update();
    const { tc, objects } = session.score.evaluation;
    announce(`Tracking capability ${tcText(tc)}: ${tally(objects)}.`);
  };
  const update = () => {
    place.hidden = session.score.evaluation === null;
    if (!session.score.evaluation) {
      delete place.dataset.tc;
      return;
    }
    place.dataset.tc = String(session.score.evaluation.tc);
    shown = display(session);
    for (const view of views) view.update();
  };
  session.score.addEventListener("scoring", rebuild);
  session.score.addEventListener("evaluation", () => {
    // Within one change the new points come with their own event.
    if (views.length > 0) update();
  });
  session.score.addEventListener("intervals", () => {
    if (views.length > 0) update();
  });
  session.score.addEventListener("selection", () => {
    // While the frames of a sequence go by, nothing here changes.
    if (views.length === 0 || display(session) === shown) return;
    shown = display(session);
    for (const view of cards) view.update();
    sequences?.update();
    trajectories?.update();
  });
  session.score.addEventListener("choice", () => {
    if (views.length > 0) matrix?.update();
  });
}

/**
 * A card an object; of many objects a table, and the card of the one on display.
 * @param {Session} session
 * @returns {View[]}
 */
function objectViews(session) {
  const { objects } = session.score.evaluation ?? { objects: [] };
  const list = h("ul", { class: "cards" });
  if (objects.length <= MOST_CARDS) {
    const cards = objects.map((_, object) => card(session, object));
    fill(list, ...cards.map(({ element }) => element));
    return [{ element: list, update: () => cards.forEach(({ update }) => update()) }];
  }
  /** @type {{ object: number, view: View } | null} */
  let shown = null;
  const update = () => {
    const { object } = session.score.selection;
    if (shown?.object !== object) {
      shown = { object, view: card(session, object) };
      fill(list, shown.view.element);
    }
    shown.view.update();
  };
  return [objectTable(session), { element: list, update }];
}

/** @param {HTMLElement[][]} elements of the tabs; one without any is not there */
function fillTabs(elements) {
  for (const [i, id] of TABS.entries()) {
    fill(byId(id), ...elements[i]);
    setAvailable(byId(id), elements[i].length > 0);
  }
}

/**
 * What is on display but for the frame in its sequence.
 * @param {Session} session
 */
function display(session) {
  const { object, frame } = session.score.selection;
  const keypoints = session.score.objects.map((_, k) => session.score.keypointOf(k));
  return [object, session.score.sequenceOf(frame)?.start, ...keypoints].join(" ");
}
