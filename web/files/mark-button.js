// @ts-check
/** The way to a ground truth for those who have none. */

import { messageOf } from "../errors.js";
import { keptMarks } from "../marking/keep.js";
import { h } from "../ui/dom.js";

/**
 * A button that opens the marking of objects by hand, where there are images and no table.
 * @param {import("../session.js").Session} session
 */
export function markButton(session) {
  if (!session.frames || (session.truth && session.marked === null)) return null;
  const isBegun = session.marked !== null || keptMarks(session) !== null;
  const label = isBegun ? "Go on marking objects" : "No table? Mark objects by hand";
  const onclick = async () => {
    try {
      const { openMarking } = await import("../marking/marking.js");
      await openMarking(session);
    } catch (error) {
      session.problems.report("marking", "error", `Marking cannot be opened: ${messageOf(error)}`);
      session.problems.changed();
    }
  };
  return h(
    "button",
    { type: "button", class: "button mark-objects opens-instead", onclick },
    label,
  );
}
