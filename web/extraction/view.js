// @ts-check
/** The extraction under way: progress, cancel, frames that could not be read. */

import { announce, byId, fill, h, icon, notice, prose } from "../ui/dom.js";
import { save } from "../ui/download.js";
import { count, duration, fixed, integer, names, significant } from "../ui/format.js";

/** @typedef {import("../session.js").Session} Session */

const LISTED_FAILURES = 50;
const LISTED_OBJECTS = 6;
/** Progress is announced to screen readers this often. */
const ANNOUNCE_EVERY_MS = 10_000;

/** @param {Session} session */
export function showExtraction(session) {
  const place = byId("extraction");
  const progress = h("progress", { id: "progress", "aria-labelledby": "extraction-title" });
  const line = h("p", { id: "progress-text", class: "progress-text" });
  const soFar = h("p", { id: "provisional", class: "provisional" });
  const cancel = button("cancel", "Cancel", () => session.cancel());
  const running = [progress, line, soFar, cancel];
  const title = h("h2", { id: "extraction-title", tabIndex: -1 }, "Extraction");
  let shown = "";
  let announced = 0;

  const update = () => {
    const { extraction, frameSources } = session;
    const nothing = !extraction || frameSources.length === 0;
    // Once there is a score, only frames that are missing in it matter.
    const isComplete = extraction?.pending(frameSources).length === 0;
    const isScored = session.score.scoring !== null && extraction?.failures.size === 0;
    place.hidden = nothing || (isComplete && isScored);
    if (nothing) {
      shown = "";
      return;
    }
    const total = frameSources.length;
    const failed = extraction.failures.size;
    const done = extraction.extracted.size + failed;
    const status = extraction.status === "idle" && done < total ? "ready" : extraction.status;
    Object.assign(place.dataset, {
      status,
      done: String(done),
      total: String(total),
      failed: String(failed),
    });
    if (status === "running") {
      progress.max = total;
      progress.value = done;
      line.textContent = describe(done, total, extraction.rate);
      if (shown !== status) announce(`Extracting keypoints from ${count(total, "frame")}.`);
      else if (performance.now() - announced < ANNOUNCE_EVERY_MS) return;
      else announce(line.textContent);
      announced = performance.now();
      if (shown !== status) fill(place, title, ...running);
      shown = status;
      return;
    }
    const state =
      `${status} ${done} ${total} ${session.score.scoring !== null} ` + `${session.table !== null}`;
    if (state === shown) return;
    const finished = shown === "running";
    const hadFocus = place.contains(document.activeElement);
    shown = state;
    fill(place, title, ...settled(session, status, done, total), ...failures(extraction.failures));
    if (hadFocus) title.focus();
    if (finished && status === "cancelled")
      announce(`Cancelled after ${integer(done)} of ${count(total, "frame")}.`);
    else if (finished && status === "idle")
      announce(`Keypoints extracted from ${count(done - failed, "frame")}.`);
  };
  session.addEventListener("extraction", update);
  session.addEventListener("files", update);
  session.score.addEventListener("preview", () => (soFar.textContent = provisional(session)));
}

/**
 * The score of the frames that are done so far.
 * @param {Session} session
 */
function provisional({ extraction, score: { provisional } }) {
  if (!provisional || !extraction) return "";
  const { tc, objects } = provisional;
  const errors = objects
    .filter(({ error }) => error !== null)
    .map(({ name, error }) => `${name} ${significant(error)}`);
  return (
    `So far, in ${count(extraction.extracted.size, "frame")}: TC ${tc === null ? "unknown" : fixed(tc)}; errors ` +
    `${names(errors.slice(0, LISTED_OBJECTS), errors.length)}.`
  );
}

/**
 * @param {number} done
 * @param {number} total
 * @param {number} rate
 */
function describe(done, total, rate) {
  const frames = `${integer(done)} of ${count(total, "frame")}`;
  if (rate === 0) return `${frames} · starting`;
  return `${frames} · ${fixed(rate, 1)} frames/s · ${duration((total - done) / rate)} left`;
}

/**
 * @param {Session} session
 * @param {string} status
 * @param {number} done
 * @param {number} total
 */
function settled(session, status, done, total) {
  const start = (/** @type {string} */ label) =>
    button("extract", label, () => void session.extract());
  switch (status) {
    case "ready":
      return [
        h("p", {}, `${count(total - done, "frame")} to extract.`),
        start("Extract keypoints"),
      ];
    case "cancelled":
      return cancelled(session, done, total);
    case "failed":
      return [notice("error", session.extraction?.error ?? ""), start("Try again")];
    default:
      return [
        h(
          "p",
          { class: "done" },
          icon("icon-check"),
          `Extracted keypoints from ${count(session.extraction?.extracted.size ?? 0, "frame")}.`,
        ),
        session.table &&
          !session.score.scoring &&
          button("save-keypoints-only", "Save keypoints as CSV", () =>
            save("keypoints.csv", "text/csv", session.table?.toCsv() ?? ""),
          ),
      ];
  }
}

/**
 * @param {Session} session
 * @param {number} done
 * @param {number} total
 */
function cancelled(session, done, total) {
  const { extraction } = session;
  const usable = extraction?.extracted.size ?? 0;
  const isScored = session.score.scoring !== null;
  const frames = `${integer(done)} of ${count(total, "frame")}`;
  const text = isScored
    ? `The score is of ${frames}.`
    : `Cancelled after ${frames}; these are kept.`;
  return [
    h("p", {}, text),
    h(
      "div",
      { class: "actions" },
      button("extract", "Continue", () => void session.extract()),
      usable > 0 &&
        session.truth !== null &&
        !session.lacksMarks &&
        !isScored &&
        button("score-partial", `Score these ${integer(usable)}`, () => {
          void session.scorePartially();
        }),
    ),
  ];
}

/** @param {Map<string, string>} failed */
function failures(failed) {
  if (failed.size === 0) return [];
  const listed = [...failed].slice(0, LISTED_FAILURES);
  const more = failed.size - listed.length;
  return [
    h(
      "details",
      { class: "failures", open: failed.size <= 3 },
      h(
        "summary",
        {},
        icon("icon-warning"),
        `${count(failed.size, "frame")} left out: no keypoints`,
      ),
      h(
        "ul",
        {},
        ...listed.map(([path, message]) =>
          h(
            "li",
            { data: { path } },
            ...prose(message.startsWith(path) ? message : `${path}: ${message}`),
          ),
        ),
        more > 0 && h("li", {}, `and ${integer(more)} more`),
      ),
    ),
  ];
}

/**
 * @param {string} id
 * @param {string} label
 * @param {() => void} onclick
 */
function button(id, label, onclick) {
  return h("button", { id, type: "button", class: "button", onclick }, label);
}
