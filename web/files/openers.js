// @ts-check
/** The ways to a ground truth and to frames for those who have none. */

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
  return opener(session, "mark-objects", label, async () => {
    const { openMarking } = await import("../marking/marking.js");
    await openMarking(session);
  });
}

/**
 * A button that opens the camera or a video, for a checkpoint.
 * @param {import("../session.js").Session} session
 */
export function liveButton(session) {
  if (!session.encoder) return null;
  return opener(session, "open-live", "Live: camera or video", async () => {
    const { openLive } = await import("../live/live.js");
    await openLive(session);
  });
}

/**
 * @param {import("../session.js").Session} session
 * @param {string} name
 * @param {string} label
 * @param {() => Promise<void>} open fetches what it opens
 */
function opener({ problems }, name, label, open) {
  const onclick = () =>
    open().catch((error) => {
      problems.report(name, "error", `This part cannot be opened: ${messageOf(error)}`);
      problems.changed();
    });
  return h("button", { type: "button", class: `button opens-instead ${name}`, onclick }, label);
}
