// @ts-check
/** How frames were joined to rows. */

import { disclosure } from "../ui/disclosure.js";
import { byId, fill, h, icon, prose } from "../ui/dom.js";
import { count, integer, names } from "../ui/format.js";
import { virtualList } from "../ui/virtual-list.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../pkg/index.js").UnmatchedSequence} UnmatchedSequence
 */

/** Height of a row in a list of sequences, in rem. */
const ROW = 2;

/** @param {Session} session */
export function showJoin(session) {
  const { join } = session;
  const place = byId("join");
  place.hidden = join === null;
  if (!join) return;
  const left = session.library.used("keypoints") ? "frames of keypoints" : "frames";
  place.dataset.matched = String(join.matched);
  place.dataset.unmatchedFrames = String(join.unmatchedFrames.count);
  place.dataset.unmatchedRows = String(join.unmatchedRows.count);
  fill(
    place,
    h("h2", { id: "join-title" }, "Frames and rows"),
    h(
      "p",
      { class: "figure-line" },
      h("strong", {}, integer(join.matched)),
      ` ${left} matched to ground truth`,
    ),
    ...unmatched("frames", `${left} have no row`, join.unmatchedFrames, join.unmatched.frames),
    ...unmatched(
      "rows",
      session.library.used("keypoints") ? "rows have no keypoints" : "rows have no frame",
      join.unmatchedRows,
      join.unmatched.rows,
    ),
    h("ul", { class: "rules" }, ...join.rules.map((rule) => h("li", {}, ...prose(rule)))),
  );
}

/**
 * @param {string} key
 * @param {string} text
 * @param {{ count: number, first: string[] }} side
 * @param {UnmatchedSequence[]} sequences all of them
 */
function unmatched(key, text, { count: number, first }, sequences) {
  if (number === 0) return [];
  const row = (/** @type {number} */ i) => {
    const { sequence, count: missing, frames } = sequences[i];
    const label = `${sequence}, frames ${frames}`;
    return h(
      "div",
      { class: "row", title: label },
      h("span", { class: "row-name" }, sequence),
      h("span", { class: "row-detail" }, frames),
      h("span", {}, integer(missing)),
    );
  };
  return [
    h(
      "div",
      { class: "unmatched" },
      icon("icon-warning"),
      h(
        "div",
        { class: "unmatched-body" },
        h("p", {}, h("strong", {}, integer(number)), ` ${text}`),
        h("p", { class: "file-reason" }, ...prose(names(first, number))),
        disclosure(
          `unmatched ${key}`,
          [`Show all, in ${count(sequences.length, "sequence")}`],
          () => virtualList(`Unmatched: ${text}`, sequences.length, ROW, row),
        ),
      ),
    ),
  ];
}
