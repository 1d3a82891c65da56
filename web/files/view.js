// @ts-check
/** The files taken, what is missing, what is wrong, and how frames were joined to rows. */

import { announce, byId, fill, h, icon } from "../ui/dom.js";
import { baseName, count, integer, names } from "../ui/format.js";
import { showJoin } from "./join-view.js";
import { showList } from "./list-view.js";
import { liveButton, markButton } from "./openers.js";
import { showProblems } from "./problems-view.js";

/** @typedef {import("../session.js").Session} Session */

/** @param {Session} session */
export function showFiles(session) {
  session.addEventListener("files", () => {
    showList(session);
    showMissing(session);
    showProblems(session);
    showJoin(session);
    showReading(session);
  });
  session.problems.addEventListener("change", () => showProblems(session));
  session.score.addEventListener("scoring", () => showJoin(session));
  session.addEventListener("reading", () => showReading(session));
}

/** @param {Session} session */
function showReading(session) {
  const { reading } = session;
  const place = byId("reading");
  place.hidden = reading === null;
  if (!reading) {
    fill(place);
    return;
  }
  const { what, done, total } = reading;
  if (!place.firstChild) {
    const progress = h("progress", { "aria-labelledby": "reading-title" });
    const line = h("p", { class: "progress-text" });
    fill(place, h("h2", { id: "reading-title" }, `${what} files`), progress, line);
    announce(total > 0 ? `${what} ${count(total, "file")}.` : `${what} files.`);
  }
  const [, progress, line] = place.children;
  if (total > 0) Object.assign(progress, { max: total, value: done });
  else progress.removeAttribute("value");
  const found = done > 0 ? `${count(done, "file")} found so far` : "Looking for files …";
  line.textContent = total > 0 ? `${integer(done)} of ${count(total, "file")}` : found;
}

/** @param {Session} session */
function showMissing(session) {
  const place = byId("missing");
  const needs = session.needs;
  place.hidden = session.library.size === 0 || needs.every(({ met }) => met);
  if (place.hidden) return;
  const ways = [markButton(session), session.frames ? null : liveButton(session)].filter(Boolean);
  fill(
    place,
    h("h2", { id: "missing-title" }, "Needed for a score"),
    h(
      "ul",
      { class: "needs" },
      ...needs.map(({ label, met, broken }) =>
        h(
          "li",
          { data: { met: String(met), broken: String(broken.length) } },
          icon(met ? "icon-check" : broken.length > 0 ? "icon-cross" : "icon-none"),
          h(
            "span",
            {},
            label,
            h("span", { class: "visually-hidden" }, met ? ": there" : ": missing"),
            broken.length > 0 &&
              h(
                "span",
                { class: "needs-broken" },
                ` ${names(broken.map(({ path }) => baseName(path)))} cannot be used`,
              ),
          ),
        ),
      ),
    ),
    ways.length > 0 && h("div", { class: "actions opens-instead" }, ...ways),
  );
}
