// @ts-check
/** The files taken, what is missing, what is wrong, and how frames found their rows. */

import { GroundTruthTable, KeypointTable } from "./pkg/index.js";
import { announce, byId, fill, h, icon, notice, prose } from "./dom.js";
import { baseName, count, integer, names } from "./format.js";

/**
 * @typedef {import("./session.js").Session} Session
 * @typedef {import("./session.js").Entry} Entry
 */

const LISTED_UNKNOWN = 5;

/** @type {Record<Entry["role"], { title: string, icon: string }>} */
const ROLES = {
  "ground-truth": { title: "Ground truth", icon: "icon-table" },
  keypoints: { title: "Keypoints", icon: "icon-table" },
  checkpoint: { title: "Checkpoint", icon: "icon-checkpoint" },
  unknown: { title: "Not used", icon: "icon-file" },
};

/** @param {Session} session */
export function showFiles(session) {
  const update = () => {
    showList(session);
    showMissing(session);
    showProblems(session);
    showJoin(session);
    showReading(session);
  };
  session.addEventListener("files", update);
  session.addEventListener("scoring", () => showJoin(session));
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
  if (!place.firstChild) {
    const progress = h("progress", { "aria-labelledby": "reading-title" });
    const line = h("p", { class: "progress-text" });
    fill(place, h("h2", { id: "reading-title" }, `${reading.what} files`), progress, line);
    announce(`${reading.what} ${count(reading.total, "file")}.`);
  }
  const [, progress, line] = place.children;
  Object.assign(progress, { max: reading.total, value: reading.done });
  line.textContent = `${integer(reading.done)} of ${count(reading.total, "file")}`;
}

/** @param {Session} session */
function showList(session) {
  const known = session.entries.filter(({ role }) => role !== "unknown");
  const unknown = session.entries.filter(({ role }) => role === "unknown");
  const items = known.map((entry) => entryItem(session, entry));
  if (session.frames) items.unshift(framesItem(session));
  items.push(...unknown.slice(0, LISTED_UNKNOWN).map((entry) => entryItem(session, entry)));
  if (unknown.length > LISTED_UNKNOWN) {
    const more = unknown.slice(LISTED_UNKNOWN);
    items.push(
      h(
        "li",
        { class: "file", data: { role: "unknown" } },
        icon("icon-file"),
        h(
          "div",
          { class: "file-body" },
          h("p", { class: "file-role" }, `${integer(more.length)} more not used`),
          h("p", { class: "file-reason" }, names(more.slice(0, 8).map(({ path }) => path), more.length)),
        ),
        removeButton("all files that are not used", () => void session.removeUnknown()),
      ),
    );
  }
  fill(byId("files"), ...items);
}

/** @param {Session} session */
function framesItem(session) {
  const sequences = session.frames?.sequences ?? [];
  const first = sequences[0]?.name;
  const last = sequences[sequences.length - 1]?.name;
  const range = sequences.length > 1 ? `${first} … ${last}` : session.frameSources[0].path;
  return h(
    "li",
    { class: "file", data: { role: "image", state: "used", frames: String(session.frameSources.length) } },
    icon("icon-frames"),
    h(
      "div",
      { class: "file-body" },
      h("p", { class: "file-role" }, "Image sequences"),
      h("p", { class: "file-name" }, range),
      h(
        "p",
        { class: "file-reason" },
        `${count(session.frameSources.length, "image")} in ${count(sequences.length, "sequence")}, one folder each`,
      ),
    ),
    removeButton("the images", () => void session.removeImages()),
  );
}

/**
 * @param {Session} session
 * @param {Entry} entry
 */
function entryItem(session, entry) {
  const role = ROLES[entry.role];
  const title = entry.state === "spare" ? `${role.title}, not used` : role.title;
  const contents = describe(entry);
  return h(
    "li",
    { class: "file", data: { role: entry.role, state: entry.state, path: entry.path } },
    icon(role.icon),
    h(
      "div",
      { class: "file-body" },
      h("p", { class: "file-role" }, entry.state === "broken" ? `${role.title}, cannot be used` : title),
      h("p", { class: "file-name", title: entry.path }, baseName(entry.path)),
      h("p", { class: "file-reason" }, ...prose(entry.reason)),
      contents && h("p", { class: "file-reason" }, contents),
      entry.notices.length > 0 && h("ul", { class: "file-notices" }, ...entry.notices.map((text) => h("li", {}, ...prose(text)))),
      entry.state === "spare" &&
        h("button", { type: "button", class: "link", onclick: () => void session.use(entry) }, "Use this one"),
      entry.error !== "" &&
        notice("error", entry.error, {
          dismiss: () => {
            entry.error = "";
            showList(session);
          },
        }),
    ),
    removeButton(baseName(entry.path), () => void session.remove(entry)),
  );
}

/** @param {Entry} entry */
function describe({ content }) {
  if (content instanceof GroundTruthTable) {
    return `${names(content.objects)} in ${count(content.frames, "frame")} of ${count(content.sequences, "sequence")}`;
  }
  if (content instanceof KeypointTable) {
    return `${count(content.keypoints, "keypoint")} in ${count(content.frames, "frame")}`;
  }
  if (content) {
    const { architecture, keypoints, inputSize } = content.info;
    const size = inputSize ? `, frames resized to ${inputSize[0]} × ${inputSize[1]}` : "";
    return `${architecture}, ${count(keypoints, "keypoint")}${size}`;
  }
  return null;
}

/**
 * @param {string} what
 * @param {() => void} remove
 */
function removeButton(what, remove) {
  return h(
    "button",
    {
      type: "button",
      class: "icon-button",
      "aria-label": `Remove ${what}`,
      title: "Remove",
      onclick: () => {
        announce(`Removed ${what}.`);
        remove();
        byId("files-title").focus();
      },
    },
    icon("icon-cross"),
  );
}

/** @param {Session} session */
function showMissing(session) {
  const place = byId("missing");
  const needs = session.needs;
  place.hidden = needs.every(({ met }) => met);
  if (place.hidden) return;
  fill(
    place,
    h("h2", { id: "missing-title" }, "Needed for a score"),
    h(
      "ul",
      { class: "needs" },
      ...needs.map(({ label, met }) =>
        h(
          "li",
          { data: { met: String(met) } },
          icon(met ? "icon-check" : "icon-none"),
          h("span", {}, label, h("span", { class: "visually-hidden" }, met ? ": there" : ": missing")),
        ),
      ),
    ),
  );
}

/** @param {Session} session */
function showProblems(session) {
  const place = byId("problems");
  // A problem that stays keeps its element, so that it is not announced again.
  const before = new Map(
    Array.from(place.children, (child) => [/** @type {HTMLElement} */ (child).dataset.text, child]),
  );
  const elements = Array.from(session.problems, ([key, { kind, text, action }]) => {
    const dismiss = () => session.dismiss(key);
    const element = before.get(text) ?? notice(kind, text, { action, dismiss });
    /** @type {HTMLElement} */ (element).dataset.text = text;
    /** @type {HTMLElement} */ (element).dataset.problem = key;
    return element;
  });
  if (elements.length !== place.children.length || elements.some((element, i) => element !== place.children[i])) {
    fill(place, ...elements);
  }
}

/** @param {Session} session */
function showJoin(session) {
  const { join } = session;
  const place = byId("join");
  place.hidden = join === null;
  if (!join) return;
  const left = session.used("keypoints") ? "frames of keypoints" : "frames";
  place.dataset.matched = String(join.matched);
  place.dataset.unmatchedFrames = String(join.unmatchedFrames.count);
  place.dataset.unmatchedRows = String(join.unmatchedRows.count);
  fill(
    place,
    h("h2", { id: "join-title" }, "Frames and rows"),
    h("p", { class: "figure-line" }, h("strong", {}, integer(join.matched)), ` ${left} have their row of ground truth`),
    ...unmatched(`${left} have no row`, join.unmatchedFrames),
    ...unmatched(session.used("keypoints") ? "rows have no keypoints" : "rows have no frame", join.unmatchedRows),
    h("ul", { class: "rules" }, ...join.rules.map((rule) => h("li", {}, ...prose(rule)))),
  );
}

/**
 * @param {string} text
 * @param {{ count: number, first: string[] }} side
 */
function unmatched(text, { count: number, first }) {
  if (number === 0) return [];
  return [
    h(
      "div",
      { class: "unmatched" },
      icon("icon-warning"),
      h("div", {}, h("p", {}, h("strong", {}, integer(number)), ` ${text}`), h("p", { class: "file-reason" }, ...prose(names(first, number)))),
    ),
  ];
}
