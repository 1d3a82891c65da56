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
import { temporalView } from "./temporal.js";
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
  const { score } = session;
  /** What follows the evaluation. @type {Parts | null} */
  let parts = null;
  /** What the cards and the sequences were last shown for. */
  let shown = "";

  const update = () => {
    place.hidden = score.evaluation === null;
    if (!score.evaluation) {
      delete place.dataset.tc;
      return;
    }
    place.dataset.tc = String(score.evaluation.tc);
    shown = display(session);
    for (const view of parts?.all ?? []) view.update();
  };
  score.addEventListener("scoring", () => {
    const wasShown = parts !== null;
    parts = score.evaluation ? partsOf(session) : null;
    fill(place, ...(parts?.score ?? []));
    fillTabs(parts?.tabs ?? TABS.map(() => []));
    update();
    if (score.evaluation) {
      const { tc, objects } = score.evaluation;
      announce(`Tracking capability ${tcText(tc)}: ${tally(objects)}.`);
    } else if (wasShown) announce("There is no score any more.");
  });
  for (const topic of ["evaluation", "intervals"]) {
    // Within one change the new points come with their own event.
    score.addEventListener(topic, () => parts && update());
  }
  score.addEventListener("selection", () => {
    // While the frames of a sequence go by, nothing here changes.
    if (!parts || display(session) === shown) return;
    shown = display(session);
    for (const view of parts.selected) view.update();
  });
  score.addEventListener("choice", () => parts?.matrix.update());
}

/**
 * @typedef {object} Parts
 * @property {View[]} all
 * @property {View[]} selected those that show the object and the sequence on display
 * @property {View} matrix
 * @property {HTMLElement[]} score the elements beside the frames
 * @property {HTMLElement[][]} tabs the elements of the tabs
 */

/**
 * The views of an evaluation.
 * @param {Session} session
 * @returns {Parts}
 */
function partsOf(session) {
  const summary = summaryView(session);
  const cards = objectViews(session);
  const matrix = matrixView(session);
  const capability = capabilityView(session);
  const sequences = new SequencesView(session);
  const { isInImage, isInSpace, scoring } = session.score;
  const trajectories = scoring && !isInSpace ? trajectoriesView(session) : null;
  const confidence = confidenceView(session);
  // They are of points in the image.
  const temporal = isInImage ? temporalView(session) : null;
  const context = isInImage ? contextView(session) : null;
  const taking = exportView(session);
  const tabs = [matrix, trajectories, capability, confidence, sequences, temporal, context, taking];
  const isThere = (/** @type {View | null} */ view) => view !== null;
  const elements = (/** @type {(View | null)[]} */ ...views) =>
    views.filter(isThere).map(({ element }) => element);
  return {
    all: [summary, ...cards, ...tabs.filter(isThere)],
    selected: [...cards, sequences, ...(trajectories ? [trajectories] : [])],
    matrix,
    score: [
      summary.element,
      h("div", { class: "objects panel" }, ...elements(...cards), summary.warnings),
    ],
    tabs: [
      elements(matrix),
      elements(trajectories),
      elements(sequences),
      elements(capability, confidence, temporal, context),
      elements(taking),
    ],
  };
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
