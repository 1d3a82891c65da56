// @ts-check
/** The list of the files taken. */

import { disclosure } from "../ui/disclosure.js";
import { announce, byId, fill, h, icon, notice, prose } from "../ui/dom.js";
import { baseName, count, fixed, integer, names } from "../ui/format.js";
import { virtualList } from "../ui/virtual-list.js";
import { ROLES, corrections, guessMark, sizeField, takesSize } from "./corrections.js";
import { contentOf, hasOtherColumns, tableOf } from "./entry.js";
import { modelSettings } from "./model-settings.js";
import { liveButton, markButton } from "./openers.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../pkg/index.js").SequenceRange} SequenceRange
 * @typedef {import("./entry.js").Entry} Entry
 * @typedef {import("./intake.js").Container} Container
 */

const LISTED_UNKNOWN = 5;
const LISTED_PROBLEMS = 3;
/** Height of a row in a list of sequences, in rem. */
const ROW = 2;

/** @type {Record<Container["kind"], string>} */
const CONTAINERS = { archive: "ZIP archive", recording: "Recording", video: "Video" };

/** @param {Session} session */
export function showList(session) {
  const isUnused = (/** @type {Entry} */ { parsed, taken }) =>
    parsed.state === "unknown" && taken.by !== "said";
  const known = session.library.entries.filter((entry) => !isUnused(entry));
  const unknown = session.library.entries.filter(isUnused);
  const items = known.map((entry) => entryItem(session, entry));
  if (session.frames) items.unshift(framesItem(session));
  items.push(...session.library.containers.map((container) => containerItem(session, container)));
  items.push(...unknown.slice(0, LISTED_UNKNOWN).map((entry) => entryItem(session, entry)));
  if (unknown.length > LISTED_UNKNOWN) {
    const more = unknown.slice(LISTED_UNKNOWN);
    items.push(
      item(
        "unknown",
        {},
        "icon-file",
        removeButton("all files that are not used", () => void session.removeUnknown()),
        [
          h("p", { class: "file-role" }, `${integer(more.length)} more not used`),
          h(
            "p",
            { class: "file-reason" },
            names(
              more.slice(0, 8).map(({ path }) => path),
              more.length,
            ),
          ),
        ],
      ),
    );
  }
  const place = byId("files");
  const focused = place.contains(document.activeElement) ? document.activeElement : null;
  fill(place, ...items);
  if (!focused) return;
  // A form that is kept has the same fields.
  if (place.contains(focused)) /** @type {HTMLElement} */ (focused).focus();
  else focusAgain(place, focused);
}

/**
 * Gives the focus to the control that took the place of another one.
 * @param {HTMLElement} place
 * @param {Element} before
 */
function focusAgain(place, before) {
  const name = before.getAttribute("name");
  const path = before.closest("li")?.dataset.path;
  if (!name || !path) return;
  const item = [...place.querySelectorAll("li")].find(({ dataset }) => dataset.path === path);
  /** @type {HTMLElement | null | undefined} */ (item?.querySelector(`[name="${name}"]`))?.focus();
}

/**
 * @param {string} role
 * @param {Record<string, string>} data
 * @param {string} symbol
 * @param {HTMLElement} remove
 * @param {import("../ui/dom.js").Child[]} body
 */
function item(role, data, symbol, remove, body) {
  return h(
    "li",
    { class: "file", data: { role, ...data } },
    icon(symbol),
    h("div", { class: "file-body" }, ...body),
    remove,
  );
}

/** @param {Session} session */
function framesItem(session) {
  const sequences = session.frames?.sequences ?? [];
  const first = sequences[0]?.name;
  const last = sequences[sequences.length - 1]?.name;
  const range = sequences.length > 1 ? `${first} … ${last}` : session.frameSources[0].path;
  const { frameSize } = session;
  const size = frameSize ? `, ${frameSize[0]} × ${frameSize[1]} px` : "";
  const data = { state: "used", frames: String(session.frameSources.length) };
  return item(
    "image",
    data,
    "icon-frames",
    removeButton("the images", () => void session.removeImages()),
    [
      h("p", { class: "file-role" }, "Image sequences"),
      h("p", { class: "file-name" }, range),
      h(
        "p",
        { class: "file-reason" },
        `${count(session.frameSources.length, "frame")} in ` +
          `${count(sequences.length, "sequence")}${size}`,
      ),
      disclosure("sequences", ["Show the sequences"], () =>
        virtualList("Sequences", sequences.length, ROW, (i) => sequenceRow(session, sequences[i])),
      ),
    ],
  );
}

/**
 * A sequence with its name, which can be changed.
 * @param {Session} session
 * @param {SequenceRange} sequence
 */
function sequenceRow(session, sequence) {
  const { name, length } = sequence;
  const field = h("input", {
    class: "row-name",
    value: name,
    "aria-label": `Name of the sequence ${name}`,
    title: "Rename the sequence",
    onchange: () => {
      const next = field.value.trim();
      if (next === "" || next === name || next.includes("/")) field.value = name;
      else void session.renameSequence(sequence, next);
    },
  });
  const remove = removeButton(`the images of ${name}`, () => void session.removeSequence(sequence));
  return h("div", { class: "row" }, field, h("span", {}, count(length, "frame")), remove);
}

/**
 * @param {Session} session
 * @param {Container} container
 */
function containerItem(session, container) {
  const { path, kind, contents, cameras, objects, error, problems } = container;
  const title = CONTAINERS[kind];
  const data = { state: error ? "broken" : "used", path };
  const remove = removeButton(
    `${baseName(path)} and what is in it`,
    () => void session.removeContainer(container),
  );
  const more =
    problems.length > LISTED_PROBLEMS
      ? [`${integer(problems.length - LISTED_PROBLEMS)} more cannot be used`]
      : [];
  return item(kind, data, "icon-archive", remove, [
    h("p", { class: "file-role" }, error ? `${title}, cannot be used` : title),
    h("p", { class: "file-name", title: path }, baseName(path)),
    contents && h("p", { class: "file-reason" }, contents),
    cameras && cameraField(session, container, cameras),
    problems.length > 0 && noticeList([...problems.slice(0, LISTED_PROBLEMS), ...more]),
    objects &&
      disclosure(`objects ${path}`, ["Say which arrays are objects"], () =>
        formOf(container, async (place) => {
          const { objectMapper } = await import("./object-mapper.js");
          place.append(objectMapper(session, container, objects));
        }),
      ),
    error && notice("error", error, { isQuiet: true }),
  ]);
}

/**
 * @param {Session} session
 * @param {Container} container
 * @param {import("./intake.js").Cameras} cameras
 */
function cameraField(session, container, { names, shown }) {
  return h(
    "label",
    { class: "choice" },
    h("span", { class: "file-reason" }, "Camera"),
    h(
      "select",
      {
        name: "camera",
        onchange: (/** @type {Event} */ { target }) =>
          void session.chooseCamera(container, /** @type {HTMLSelectElement} */ (target).value),
      },
      ...names.map((name) => h("option", { value: name, selected: name === shown }, name)),
    ),
  );
}

/**
 * Forms of files: what is half entered outlasts that the list is drawn anew.
 * @type {WeakMap<Entry | Container, HTMLElement>}
 */
const forms = new WeakMap();

/**
 * The form of a file, filled once that can be done.
 * @param {Entry | Container} of
 * @param {(place: HTMLElement) => Promise<void>} make
 */
function formOf(of, make) {
  const before = forms.get(of);
  if (before) return before;
  const place = h("div", { class: "corrections" });
  forms.set(of, place);
  void make(place);
  return place;
}

/** @param {string[]} texts */
function noticeList(texts) {
  return h("ul", { class: "file-notices" }, ...texts.map((text) => h("li", {}, ...prose(text))));
}

/**
 * @param {Session} session
 * @param {Entry} entry
 */
function entryItem(session, entry) {
  const { path, parsed, taken } = entry;
  const role = ROLES[taken.role];
  const isResult = taken.role === "result";
  const contents = describe(entry);
  const notices = [...entry.told, ...(tableOf(entry)?.notices ?? [])];
  const error = parsed.state === "broken" ? parsed.error : "";
  const remove = removeButton(baseName(path), () => void session.remove(entry));
  return item(taken.role, { state: parsed.state, path }, role.icon, remove, [
    h("p", { class: "file-role" }, titleOf(session, entry), taken.by === "guess" && guessMark()),
    h("p", { class: "file-name", title: path }, baseName(path)),
    taken.reason && h("p", { class: "file-reason" }, ...prose(taken.reason)),
    contents && h("p", { class: "file-reason" }, contents),
    notices.length > 0 && noticeList(notices),
    takesSize(session, entry) && sizeField(session, entry),
    ...modelSettings(session, entry),
    parsed.state !== "new" && !isResult && corrections(session, entry),
    ...useOf(session, entry),
    entry.parsed.state === "used" && openerOf(session, entry),
    hasOtherColumns(entry) &&
      disclosure(`columns ${path}`, ["Its columns have other names"], () =>
        formOf(entry, async (place) => {
          const { askColumns } = await import("./column-mapper.js");
          await askColumns(place, session, entry);
        }),
      ),
    error !== "" &&
      notice("error", error, { isQuiet: true, dismiss: () => session.dismissError(path) }),
  ]);
}

/**
 * Whether a file is there, but not shown.
 * @param {Session} session
 * @param {Entry} entry
 */
function isIdle(session, { path, parsed, taken }) {
  if (parsed.state === "spare") return true;
  return taken.role === "result" && parsed.state === "used" && session.score.savedIn?.path !== path;
}

/**
 * What a file is, and whether it is used.
 * @param {Session} session
 * @param {Entry} entry
 */
function titleOf(session, entry) {
  const { parsed, taken } = entry;
  const { title } = ROLES[taken.role];
  if (parsed.state === "broken") return `${title}, cannot be used`;
  if (!isIdle(session, entry)) return title;
  if (taken.role === "result") return `${title}, not shown`;
  return `${title}, ${session.isCompared(entry) ? "compared" : "not used"}`;
}

/**
 * The way to use a file that is not shown, or why there is none.
 * @param {Session} session
 * @param {Entry} entry
 */
function useOf(session, entry) {
  if (!isIdle(session, entry)) return [];
  const isResult = entry.taken.role === "result";
  if (isResult && session.score.scoring) {
    const text = "The score of the files here is shown; the two are compared below.";
    return [h("p", { class: "file-reason" }, text)];
  }
  if (entry.parsed.state !== "spare") return [];
  const label = isResult || session.isCompared(entry) ? "Show this one" : "Use this one";
  const onclick = () => void session.use(entry);
  return [h("button", { type: "button", class: "link", onclick }, label)];
}

/**
 * What a file that is used can be gone on with.
 * @param {Session} session
 * @param {Entry} entry
 */
function openerOf(session, { marked, taken }) {
  if (marked !== null) return markButton(session);
  // Without frames it is offered in their place.
  return taken.role === "checkpoint" && session.frames ? liveButton(session) : null;
}

/** @param {Entry} entry */
function describe(entry) {
  const content = contentOf(entry);
  switch (content?.kind) {
    case "ground-truth": {
      const { objects, frames, sequences } = content.table;
      const where = `${count(frames, "frame")} of ${count(sequences, "sequence")}`;
      return `${names(objects)} in ${where}`;
    }
    case "keypoints": {
      const { keypoints, frames } = content.table;
      return `${count(keypoints, "keypoint")} in ${count(frames, "frame")}`;
    }
    case "camera": {
      const [width, height] = content.camera.imageSize;
      return `its images have ${width} × ${height} px`;
    }
    case "result": {
      const { tc, objects, errors, frames, version } = content.saved.evaluation;
      return (
        `TC ${tc === null ? "unknown" : fixed(tc)} of ${names(objects.map(({ name }) => name))}; ` +
        `${count(errors[0]?.length ?? 0, "keypoint")} in ${count(frames, "frame")}; by tracklens ` +
        version
      );
    }
    case "checkpoint": {
      const { architecture, keypoints, inputSize } = content.encoder.info;
      const size = inputSize ? `, frames resized to ${inputSize[0]} × ${inputSize[1]}` : "";
      return `${architecture}, ${count(keypoints, "keypoint")}${size}`;
    }
    default:
      return null;
  }
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
