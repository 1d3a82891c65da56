// @ts-check
/** Measures of the best keypoints over time, computed when they are looked at. */

import { tableView } from "../comparison/tables.js";
import { messageOf } from "../errors.js";
import init, { temporalTable } from "../pkg/index.js";
import { fill, h, notice } from "../ui/dom.js";
import { sentence } from "../ui/format.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../pkg/index.js").Evaluation} Evaluation
 */

const MEASURES = "jitter, lag, hand-over, other maps, TAP-Vid, OKS, PCK";

/** @param {Session} session */
export function temporalView(session) {
  const { score } = session;
  const body = h("div", { class: "context-body" });
  /** What the table is of. @type {Evaluation | null} */
  let shown = null;
  const element = h(
    "details",
    { class: "panel context", id: "temporal", ontoggle: () => void update() },
    h("summary", {}, h("h3", {}, "Temporal quality"), ` ${MEASURES}`),
    body,
  );
  const update = async () => {
    const { evaluation } = score;
    if (!element.open || !evaluation || evaluation === shown) return;
    shown = evaluation;
    try {
      await init(["figures"]);
      const temporal = await session.temporalQuality();
      if (evaluation !== score.evaluation) return;
      const table = temporal && temporalTable({ ...evaluation, temporal });
      if (table) {
        // Its caption is the summary.
        const [, ...parts] = tableView(table, new Map());
        fill(body, ...parts);
      } else fill(body, h("p", {}, "The saved evaluation has none."));
    } catch (error) {
      if (evaluation === shown) fill(body, notice("error", sentence(messageOf(error))));
    }
  };
  return { element, update: () => void update() };
}
