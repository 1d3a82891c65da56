// @ts-check
/** The files taken, what is missing, what is wrong, and how frames found their rows. */

import { GroundTruthTable, KeypointTable } from "../pkg/index.js";
import { announce, byId, fill, h, icon, notice, prose } from "../ui/dom.js";
import { baseName, count, fixed, integer, names } from "../ui/format.js";
import { isTable } from "./intake.js";
import { SavedEvaluation } from "./saved.js";
import { virtualList } from "../ui/virtual-list.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./intake.js").Container} Container
 * @typedef {import("./intake.js").Entry} Entry
 * @typedef {import("../pkg/index.js").TableOptions} TableOptions
 * @typedef {import("../pkg/index.js").UnmatchedSequence} UnmatchedSequence
 */

const LISTED_UNKNOWN = 5;
const LISTED_PROBLEMS = 3;
const LISTED_BROKEN = 3;
/** Height of a row in a list of sequences, in rem. */
const ROW = 2;

/** @type {Record<Entry["role"], { title: string, icon: string }>} */
const ROLES = {
  "ground-truth": { title: "Ground truth", icon: "icon-table" },
  keypoints: { title: "Keypoints", icon: "icon-table" },
  checkpoint: { title: "Checkpoint", icon: "icon-checkpoint" },
  result: { title: "Saved evaluation", icon: "icon-file" },
  unknown: { title: "Not used", icon: "icon-file" },
};

/** @type {Record<Container["kind"], string>} */
const CONTAINERS = { archive: "ZIP archive", recording: "Recording", video: "Video" };

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

/** Lists that the user opened stay open when the files change. @type {Set<string>} */
const opened = new Set();
/** And where they were scrolled to. @type {Map<string, number>} */
const scrolled = new Map();

/** @param {Session} session */
function showList(session) {
  const isUnused = (/** @type {Entry} */ { role, state, isSaid }) =>
    role === "unknown" && state === "unknown" && !isSaid;
  const known = session.entries.filter((entry) => !isUnused(entry));
  const unknown = session.entries.filter(isUnused);
  const items = known.map((entry) => entryItem(session, entry));
  if (session.frames) items.unshift(framesItem(session));
  items.push(...session.containers.map((container) => containerItem(session, container)));
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
  if (focused) focusAgain(place, focused);
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
      disclosure("sequences", "The sequences", () =>
        virtualList("Sequences", sequences.length, ROW, (i) => {
          const { name, length } = sequences[i];
          const remove = removeButton(
            `the images of ${name}`,
            () => void session.removeSequence(sequences[i]),
          );
          return h(
            "div",
            { class: "row" },
            h("span", { class: "row-name", title: name }, name),
            h("span", {}, count(length, "frame")),
            remove,
          );
        }),
      ),
    ],
  );
}

/**
 * @param {Session} session
 * @param {Container} container
 */
function containerItem(session, container) {
  const { path, kind, contents, error, problems } = container;
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
    problems.length > 0 && noticeList([...problems.slice(0, LISTED_PROBLEMS), ...more]),
    error && notice("error", error, { isQuiet: true }),
  ]);
}

/**
 * Something that is made when it is opened.
 * @param {string} key
 * @param {string} title
 * @param {() => HTMLElement} make
 */
function disclosure(key, title, make) {
  const details = h("details", { class: "disclosure", data: { key } }, h("summary", {}, title));
  const update = () => {
    if (details.open) opened.add(key);
    else opened.delete(key);
    if (!details.open || details.childElementCount > 1) return;
    const made = make();
    details.append(made);
    made.scrollTop = scrolled.get(key) ?? 0;
    made.addEventListener("scroll", () => scrolled.set(key, made.scrollTop), { passive: true });
  };
  details.addEventListener("toggle", update);
  details.open = opened.has(key);
  return details;
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
  const role = ROLES[entry.role];
  const isResult = entry.role === "result";
  const isIdle =
    entry.state === "spare" || (isResult && entry.state === "used" && session.savedIn !== entry);
  const idle = isResult ? "not shown" : session.isCompared(entry) ? "compared" : "not used";
  const title = isIdle ? `${role.title}, ${idle}` : role.title;
  const contents = describe(entry);
  const data = { state: entry.state, path: entry.path };
  const remove = removeButton(baseName(entry.path), () => void session.remove(entry));
  return item(entry.role, data, role.icon, remove, [
    h(
      "p",
      { class: "file-role" },
      entry.state === "broken" ? `${role.title}, cannot be used` : title,
      entry.isGuess && guessMark(),
    ),
    h("p", { class: "file-name", title: entry.path }, baseName(entry.path)),
    entry.reason && h("p", { class: "file-reason" }, ...prose(entry.reason)),
    contents && h("p", { class: "file-reason" }, contents),
    entry.notices.length > 0 && noticeList(entry.notices),
    takesSize(session, entry) && sizeField(session, entry),
    entry.state !== "new" && !isResult && corrections(session, entry),
    isResult &&
      isIdle &&
      session.scoring !== null &&
      h(
        "p",
        { class: "file-reason" },
        "The score of the files here is shown; the two are compared below.",
      ),
    entry.state === "spare" &&
      !(isResult && session.scoring) &&
      h(
        "button",
        { type: "button", class: "link", onclick: () => void session.use(entry) },
        isResult || session.isCompared(entry) ? "Show this one" : "Use this one",
      ),
    entry.error !== "" &&
      notice("error", entry.error, {
        isQuiet: true,
        dismiss: () => session.dismissError(entry.path),
      }),
  ]);
}

/**
 * Whether the size of the images is asked for at a file: its positions are in pixels, and no image
 * says it.
 * @param {Session} session
 * @param {Entry} entry
 */
function takesSize({ frameSize, saidSize }, { content, lacksSize }) {
  if (frameSize) return false;
  return (
    lacksSize ||
    (saidSize !== undefined && isTable(content) && content.reading.space.value === "px")
  );
}

/**
 * Width and height of images that are not here.
 * @param {Session} session
 * @param {Entry} entry
 */
function sizeField(session, { path }) {
  const hint = h("span", { class: "hint", role: "status" });
  const side = (/** @type {"width" | "height"} */ name, /** @type {number | undefined} */ value) =>
    h("input", {
      type: "number",
      name: `image-${name}`,
      min: "1",
      step: "1",
      inputMode: "numeric",
      "aria-label": `Image ${name} in pixels, for ${baseName(path)}`,
      value: value === undefined ? "" : String(value),
      onchange: () => take(),
    });
  const [width, height] = [
    side("width", session.saidSize?.[0]),
    side("height", session.saidSize?.[1]),
  ];
  const take = () => {
    const size = /** @type {[number, number]} */ ([width.valueAsNumber, height.valueAsNumber]);
    const isSide = (/** @type {number} */ pixels) => Number.isInteger(pixels) && pixels > 0;
    const isEmpty = width.value === "" || height.value === "";
    const isValid = size.every(isSide);
    hint.textContent = isEmpty || isValid ? "" : "Expected whole numbers of pixels above 0.";
    for (const [i, input] of [width, height].entries()) {
      input.setAttribute("aria-invalid", String(input.value !== "" && !isSide(size[i])));
    }
    const isTakenBack = width.value === "" && height.value === "" && session.saidSize !== undefined;
    if (isValid || isTakenBack) void session.setImageSize(isValid ? size : undefined);
  };
  return h(
    "fieldset",
    { class: "image-size" },
    h("legend", {}, "Size of the images"),
    h("span", { class: "image-size-sides" }, width, "×", height, "px"),
    hint,
  );
}

function guessMark() {
  return h(
    "span",
    { class: "guess", title: "Nothing in the file says so; correct it if it is wrong" },
    "a guess",
  );
}

/** @type {Record<string, string>} */
const GROUNDS = { guess: "a guess", file: "by the file", said: "as you said" };

/**
 * What the file was taken for, to be corrected.
 * @param {Session} session
 * @param {Entry} entry
 */
function corrections(session, entry) {
  const reading = isTable(entry.content) ? entry.content.reading : null;
  const isTableRole = entry.role === "ground-truth" || entry.role === "keypoints";
  const set = (/** @type {TableOptions} */ options) => void session.setTableOptions(entry, options);
  const key = `corrections ${entry.path}`;
  const summary = reading
    ? [
        reading.space.value === "px" ? "pixels" : "ndc",
        `(${[...reading.axisOrder.value].join(", ")})`,
        `frames from ${reading.indexBase.value}`,
      ].join(" · ")
    : "Taken for something else?";
  const isGuess =
    reading !== null &&
    [reading.space, reading.axisOrder, reading.indexBase].some(({ by }) => by === "guess");
  const details = h(
    "details",
    { class: "disclosure", data: { key } },
    h("summary", {}, summary, isGuess && guessMark()),
    h(
      "div",
      { class: "corrections" },
      choice(
        "Role",
        "role",
        rolesOf(entry).map((role) => [role, ROLES[role].title]),
        entry.role,
        entry.isSaid ? "said" : entry.isGuess ? "guess" : "file",
        (role) => void session.setRole(entry, /** @type {Entry["role"]} */ (role)),
      ),
      isTableRole &&
        choice(
          "Unit",
          "space",
          [
            ["ndc", "ndc, −1 to +1"],
            ["px", "pixels"],
          ],
          reading?.space.value ?? entry.options.space ?? "ndc",
          reading?.space.by ?? "guess",
          (space) => set({ space: /** @type {"ndc" | "px"} */ (space) }),
        ),
      isTableRole &&
        choice(
          "Axes",
          "axisOrder",
          [
            ["xy", "x, y"],
            ["yx", "y, x"],
          ],
          reading?.axisOrder.value ?? entry.options.axisOrder ?? "xy",
          reading?.axisOrder.by ?? "guess",
          (axisOrder) => set({ axisOrder: /** @type {"xy" | "yx"} */ (axisOrder) }),
        ),
      isTableRole &&
        !entry.arrays &&
        choice(
          "First frame",
          "indexBase",
          [
            ["0", "0"],
            ["1", "1"],
          ],
          String(reading?.indexBase.value ?? entry.options.indexBase ?? 0),
          reading?.indexBase.by ?? "guess",
          (base) => set({ indexBase: Number(base) }),
        ),
    ),
  );
  details.addEventListener("toggle", () => (details.open ? opened.add(key) : opened.delete(key)));
  details.open = opened.has(key);
  return details;
}

/**
 * What a file could be.
 * @param {Entry} entry
 * @returns {Entry["role"][]}
 */
function rolesOf({ role, arrays, content, path }) {
  const points = /** @type {Entry["role"][]} */ (["ground-truth", "keypoints"]);
  if (arrays || isTable(content) || /\.(csv|tsv|txt|json)$/i.test(path))
    return [...points, "unknown"];
  return role === "checkpoint" ? ["checkpoint", "unknown"] : [...points, "checkpoint", "unknown"];
}

/**
 * A choice with what the present value rests on.
 * @param {string} label
 * @param {string} name
 * @param {string[][]} options value and text
 * @param {string} value
 * @param {string} by
 * @param {(value: string) => void} change
 */
function choice(label, name, options, value, by, change) {
  return h(
    "label",
    { class: "choice", data: { by } },
    h("span", {}, label),
    h(
      "select",
      {
        name,
        onchange: (/** @type {Event} */ { target }) =>
          change(/** @type {HTMLSelectElement} */ (target).value),
      },
      ...options.map(([option, text]) =>
        h("option", { value: option, selected: option === value }, text),
      ),
    ),
    h("small", {}, GROUNDS[by]),
  );
}

/** @param {Entry} entry */
function describe({ content }) {
  if (content instanceof GroundTruthTable) {
    return (
      `${names(content.objects)} in ${count(content.frames, "frame")} of ` +
      `${count(content.sequences, "sequence")}`
    );
  }
  if (content instanceof KeypointTable) {
    return `${count(content.keypoints, "keypoint")} in ${count(content.frames, "frame")}`;
  }
  if (content instanceof SavedEvaluation) {
    const { tc, objects, errors, frames, version } = content.evaluation;
    return (
      `TC ${fixed(tc)} of ${names(objects.map(({ name }) => name))}; ` +
      `${count(errors[0]?.length ?? 0, "keypoint")} in ` +
      `${count(frames, "frame")}; by tracklens ${version}`
    );
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
  );
}

/**
 * What is wrong, over everything else: of the session, and of the files that cannot be used.
 * @param {Session} session
 */
function showProblems(session) {
  const place = byId("problems");
  // A problem that stays keeps its element, so that it is not announced again.
  const before = new Map(
    Array.from(place.children, (child) => {
      const { problem, text } = /** @type {HTMLElement} */ (child).dataset;
      return [`${problem} ${text}`, child];
    }),
  );
  const elements = problemsOf(session).map(({ key, kind, text, action, dismiss }) => {
    const known = before.get(`${key} ${text}`);
    // What the problem of this name asks for when it is clicked: files may have been replaced since
    // it was first told.
    const now = () => problemsOf(session).find((problem) => problem.key === key);
    const element =
      known ??
      notice(kind, text, {
        action: action && { label: action.label, run: () => now()?.action?.run() },
        dismiss: dismiss && (() => now()?.dismiss?.()),
      });
    // An error is an alert, which speaks for itself.
    if (!known && kind !== "error") announce(text);
    Object.assign(/** @type {HTMLElement} */ (element).dataset, { problem: key, text });
    return element;
  });
  if (
    elements.length !== place.children.length ||
    elements.some((element, i) => element !== place.children[i])
  ) {
    fill(place, ...elements);
  }
}

/**
 * @param {Session} session
 * @returns {(import("../score.js").Problem & { key: string, dismiss?: () => void })[]}
 */
function problemsOf(session) {
  const { broken } = session;
  const left = broken.length - LISTED_BROKEN;
  return [
    ...Array.from(session.problems, ([key, problem]) => ({
      key,
      ...problem,
      dismiss: () => session.dismiss(key),
    })),
    ...broken.slice(0, LISTED_BROKEN).map((file) => ({
      key: `broken ${file.path}`,
      kind: /** @type {const} */ ("error"),
      text: file.error,
      action: {
        label: `Show ${baseName(file.path)} among the files`,
        run: () => showFile(file.path),
      },
      dismiss: () => session.dismissError(file.path),
    })),
    ...(left > 0
      ? [
          {
            key: "broken",
            kind: /** @type {const} */ ("error"),
            text: `${count(left, "more file")} cannot be used; the list of files says why.`,
            action: { label: "Show the files", run: () => byId("files-title").focus() },
          },
        ]
      : []),
  ];
}

/**
 * Brings a file of the list into sight.
 * @param {string} path
 */
function showFile(path) {
  const files = /** @type {HTMLElement[]} */ ([...byId("files").children]);
  const item = files.find(({ dataset }) => dataset.path === path) ?? byId("files-title");
  item.tabIndex = -1;
  item.scrollIntoView({ block: "center" });
  // What is missing can be entered at once.
  const field = /** @type {HTMLElement | null} */ (item.querySelector(".image-size input"));
  (field ?? item).focus({ preventScroll: true });
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
    h(
      "p",
      { class: "figure-line" },
      h("strong", {}, integer(join.matched)),
      ` ${left} have their row of ground truth`,
    ),
    ...unmatched("frames", `${left} have no row`, join.unmatchedFrames, join.unmatched.frames),
    ...unmatched(
      "rows",
      session.used("keypoints") ? "rows have no keypoints" : "rows have no frame",
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
          `All of them, in ${count(sequences.length, "sequence")}`,
          () => virtualList(`What is unmatched: ${text}`, sequences.length, ROW, row),
        ),
      ),
    ),
  ];
}
