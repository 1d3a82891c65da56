// @ts-check
/** The comparison of runs: tables, figures, runs left out, and files to save. */

import { announce, byId, fill, h, icon, notice } from "../ui/dom.js";
import { save } from "../ui/download.js";
import { baseName, count, duration, fixed, integer, significant } from "../ui/format.js";
import { scrollRegion } from "../ui/scroll-region.js";

/**
 * @typedef {import("./comparison.js").RunsComparison} RunsComparison
 * @typedef {import("../pkg/index.js").Compared} Compared
 * @typedef {import("../pkg/index.js").Figure} Figure
 * @typedef {import("../pkg/index.js").RunDataSet} RunDataSet
 * @typedef {import("../pkg/index.js").RunsReport} RunsReport
 */

/**
 * A column of a table: its heading, what a row shows in it, and what it is sorted by.
 * @template T
 * @typedef {{ label: string, text: (row: T) => import("../ui/dom.js").Child, value?: (row: T) => string
 * | number | null,
 *   isText?: boolean, isGood?: (row: T) => boolean }} Column
 */

const NONE = "–";
/** Pixels of a PNG for one of the figure. */
const PNG_SCALE = 2;

/** @param {RunsComparison} comparison */
export function showComparison(comparison) {
  const place = byId("comparison");
  let told = "";
  /** By what the table of runs is sorted. */
  const order = { column: 0, down: false };

  const rebuild = () => {
    const { dataSets, unread, unscored, pending, reading, error } = comparison;
    const runs = dataSets.reduce((sum, set) => sum + set.runs.length, 0) + unread.length;
    place.hidden = runs === 0 && unscored.length + pending.length < 2 && !reading && !error;
    document.documentElement.dataset.runs = String(comparison.size > 0);
    if (place.hidden) {
      fill(place);
      Object.assign(place.dataset, { runs: "0", complete: "0", groups: "0" });
      return;
    }
    const set = dataSets[comparison.options.dataSet];
    const report = comparison.compared?.report ?? null;
    const groups = report?.groups ?? [];
    const complete = groups.reduce((sum, group) => sum + group.complete, 0);
    Object.assign(place.dataset, {
      runs: String(runs),
      complete: String(complete),
      groups: String(groups.length),
    });
    // A control that changes the comparison is made anew, too.
    const focused = place.contains(document.activeElement) ? document.activeElement?.id : "";
    const summary = report
      ? `${count(complete, "run")} compared in ${count(groups.length, "group")}`
      : `${count(runs, "run")}, none to compare`;
    fill(
      place,
      h(
        "div",
        { class: "panel comparison-head" },
        h("h2", { id: "comparison-title", tabindex: "-1" }, "Runs side by side"),
        h(
          "p",
          { class: "comparison-summary" },
          reading
            ? `Reading runs: ${integer(reading.done)} of ${integer(reading.total)}`
            : `${summary}.`,
        ),
        set && settings(comparison),
        ...notices(comparison, set, report),
      ),
      ...(report && comparison.compared ? compared(comparison.compared, report, order) : []),
      dropped(comparison, set),
    );
    if (focused) document.getElementById(focused)?.focus();
    if (summary !== told) announce(`${summary}.`);
    told = summary;
  };
  comparison.addEventListener("change", rebuild);
  comparison.addEventListener("progress", () => {
    const { reading, extracting } = comparison;
    if (extracting) showProgress(place, extracting, rebuild);
    const line = place.querySelector(".comparison-summary");
    if (reading && line)
      line.textContent = `Reading runs: ${integer(reading.done)} of ${integer(reading.total)}`;
    else if (reading) rebuild();
  });
}

/** @param {RunsComparison} comparison */
function settings(comparison) {
  const { dataSets, options } = comparison;
  const set = dataSets[options.dataSet];
  const select = (
    /** @type {string} */ id,
    /** @type {string} */ label,
    /** @type {[string, string][]} */ choices,
    /** @type {string} */ value,
  ) => {
    const element = h(
      "select",
      {
        id,
        onchange: () =>
          comparison.setOptions(
            id === "compare-set" ? { dataSet: Number(element.value) } : { groupBy: element.value },
          ),
      },
      ...choices.map(([key, text]) => h("option", { value: key, selected: key === value }, text)),
    );
    return h("label", { class: "field" }, h("span", {}, label), element);
  };
  /** @type {[string, string][]} */
  const groupings = [
    ["settings", "All settings but the seed"],
    ["architecture", "Architecture"],
    ["name", "Name"],
    .../** @type {[string, string][]} */ (set.settings.map((name) => [name, `Setting: ${name}`])),
  ];
  const describe = (/** @type {RunDataSet} */ { trained, runs, objects }) =>
    `${count(runs.length, trained ? "training" : "scored detector", trained ? "trainings" : "scored detectors")} (${objects.join(", ")})`;
  return h(
    "div",
    { class: "settings" },
    dataSets.length > 1 &&
      select(
        "compare-set",
        "Data set",
        dataSets.map((each, i) => [String(i), describe(each)]),
        String(options.dataSet),
      ),
    select("compare-group", "Groups by", groupings, options.groupBy),
    comparison.size > 0 &&
      h(
        "button",
        {
          type: "button",
          id: "remove-runs",
          class: "button",
          data: { kind: "quiet" },
          onclick: () => comparison.clear(),
        },
        "Remove the runs",
      ),
  );
}

/**
 * Checkpoints without keypoints: the way to them, or how far the extraction is.
 * @param {RunsComparison} comparison
 */
function pendingNotice(comparison) {
  const { extracting, failed, pending } = comparison;
  if (extracting) {
    return h(
      "div",
      { id: "compare-extracting", class: "work" },
      h("p", {}, `Extracting keypoints with ${baseName(extracting.path)}`),
      h("progress", { max: extracting.total, value: extracting.done, "aria-label": "Extraction" }),
      h("p", { class: "progress-text" }, progressText(extracting)),
      h(
        "button",
        {
          id: "compare-cancel",
          type: "button",
          class: "button",
          onclick: () => comparison.cancel(),
        },
        "Cancel",
      ),
    );
  }
  const files = pending.map(({ path }) => baseName(path)).join(", ");
  const reasons = pending.flatMap(({ path }) => failed.get(path) ?? []);
  const text =
    `${count(pending.length, "checkpoint")} without keypoints of these frames: ` + `${files}.`;
  return notice(reasons.length > 0 ? "warning" : "info", [text, ...reasons].join(" "), {
    action: {
      label: pending.length === 1 ? "Extract them" : "Extract them all",
      run: () => void comparison.extract(),
    },
  });
}

/** @param {{ done: number, total: number, rate: number }} extracting */
function progressText({ done, total, rate }) {
  const frames = `${integer(done)} of ${count(total, "frame")}`;
  return rate === 0 ? frames : `${frames} · ${duration((total - done) / rate)} left`;
}

/**
 * @param {HTMLElement} place
 * @param {NonNullable<RunsComparison["extracting"]>} extracting
 * @param {() => void} rebuild shows the progress where there is none yet
 */
function showProgress(place, extracting, rebuild) {
  const shown = place.querySelector("#compare-extracting");
  const name = `Extracting keypoints with ${baseName(extracting.path)}`;
  if (!shown || shown.firstElementChild?.textContent !== name) {
    rebuild();
    return;
  }
  const progress = /** @type {HTMLProgressElement} */ (shown.querySelector("progress"));
  progress.value = extracting.done;
  const line = /** @type {HTMLElement} */ (shown.querySelector(".progress-text"));
  line.textContent = progressText(extracting);
}

/**
 * @param {RunsComparison} comparison
 * @param {RunDataSet | undefined} set
 * @param {RunsReport | null} report
 */
function notices(comparison, set, report) {
  const { dataSets, doubts, error, pending, unscored } = comparison;
  const more = dataSets.slice(1).map(({ reason }) => reason);
  return [
    dataSets.length > 1 &&
      notice(
        "info",
        `The runs are of ${dataSets.length} data sets, whose errors cannot be compared: ` +
          `${more.join("; ")}. One is shown at a time.`,
      ),
    error && notice("error", error),
    pending.length > 0 && pendingNotice(comparison),
    ...unscored.map(({ name, reason }) => notice("warning", `${name} cannot be scored: ${reason}`)),
    ...(report?.notes ?? []).map((note) => notice("warning", `${note}.`)),
    ...doubts.map((text) => notice("warning", `${text}.`)),
    set &&
      !set.trained &&
      notice(
        "info",
        comparison.saved > 0
          ? "Saved evaluations count with the errors they were saved with; what is scored here, " +
              "with the map set above."
          : "These detectors are scored on the frames here, with the map and the thresholds set " +
              "above.",
      ),
  ].filter(Boolean);
}

/**
 * @param {Compared} compared
 * @param {RunsReport} report
 * @param {{ column: number, down: boolean }} order
 */
function compared(compared, report, order) {
  // Of groups with one run each, statistics over runs say nothing that the errors do not.
  const hasSpread = report.groups.some((group) => group.complete > 1);
  return [
    h("div", { class: "panel" }, ...(hasSpread ? statistics(report) : onlyErrors(report))),
    h(
      "div",
      { class: "panel comparison-figures" },
      ...compared.figures.map((each) => figureView(each)),
    ),
    h(
      "div",
      { class: "panel" },
      h("h3", {}, "Runs"),
      runTable(report, order),
      downloads(compared, report),
    ),
  ];
}

/** @param {RunsReport} report */
function statistics(report) {
  return [
    h("h3", {}, "Tracking capability"),
    h(
      "p",
      { class: "hint-line" },
      `The share of runs whose error is at most the threshold. Small figures: ${report.intervals}.`,
    ),
    capabilityTable(report),
    h("h3", {}, "Tracking errors"),
    h(
      "p",
      { class: "hint-line" },
      "Mean squared distance in ndc. IQM: interquartile mean, trimmed as in rliable, and between " +
        "the quartiles.",
    ),
    errorTable(report),
  ];
}

/**
 * The error of every object and detector, where a group has one run at most.
 * @param {RunsReport} report
 */
function onlyErrors(report) {
  const objects = report.groups[0]?.objects ?? [];
  const thresholds = objects.map(({ name, threshold }) => `${name} ${threshold}`).join(", ");
  const cell = (/** @type {number | null | undefined} */ error, /** @type {number} */ threshold) =>
    error !== null && error !== undefined && error <= threshold
      ? h(
          "span",
          { class: "good" },
          `${significant(error)} ✓`,
          h("span", { class: "visually-hidden" }, " tracked"),
        )
      : significant(error);
  return [
    h("h3", {}, "Tracking errors"),
    h(
      "p",
      { class: "hint-line" },
      `Mean squared distance in ndc; ✓ tracked: at most the threshold (${thresholds}). Every ` +
        "group has one run at most, so there are no statistics over runs.",
    ),
    table("only-errors-table", "Tracking errors by detector and object", [
      ["Group", "TC", ...objects.map(({ name }) => name)],
      ...report.groups.map(({ name, tc, runs }) => [
        name,
        tc === null ? NONE : fixed(tc),
        ...objects.map(({ threshold }, k) => cell(runs[0]?.errors[k], threshold)),
      ]),
    ]),
  ];
}

/**
 * @param {number | null} value
 * @param {[number, number] | null} interval
 * @param {number} digits
 */
function withInterval(value, interval, digits) {
  if (value === null) return [NONE];
  const [low, high] = interval ?? [];
  return [
    fixed(value, digits),
    low !== undefined &&
      high !== undefined &&
      h("small", {}, ` ${fixed(low, digits)}–${fixed(high, digits)}`),
  ];
}

/** @param {RunsReport} report */
function capabilityTable(report) {
  const objects = report.groups[0]?.objects ?? [];
  return table("capability-table", "Tracking capability by group", [
    ["Group", "Runs", "Mean TC", ...objects.map(({ name }) => `TC ${name}`)],
    ...report.groups.map((group) => [
      group.name,
      [
        integer(group.complete),
        group.incomplete.length > 0 && h("small", {}, ` +${group.incomplete.length} incomplete`),
      ],
      withInterval(group.tc, group.tc_interval, 3),
      ...group.objects.map((object) => withInterval(object.tc, object.tc_interval, 2)),
    ]),
  ]);
}

/** @param {RunsReport} report */
function errorTable(report) {
  return table("error-table", "Tracking errors by group and object", [
    [
      "Group",
      "Object",
      "Mean",
      "Variance",
      "Median",
      "Quartiles",
      "IQM trimmed",
      "IQM between quartiles",
    ],
    ...report.groups.flatMap((group) =>
      group.objects.map((object, k) => [
        k === 0 ? group.name : "",
        object.name,
        significant(object.mean),
        significant(object.variance),
        significant(object.quartiles?.[2]),
        object.quartiles
          ? `${significant(object.quartiles[1])}–${significant(object.quartiles[3])}`
          : NONE,
        withInterval(object.iqm_trimmed, object.iqm_interval, 4),
        significant(object.iqm_window),
      ]),
    ),
  ]);
}

/**
 * @param {string} id
 * @param {string} caption
 * @param {(import("../ui/dom.js").Child | import("../ui/dom.js").Child[])[][]} rows the first one is the
 * header
 */
function table(id, caption, [header, ...rows]) {
  const cells = (
    /** @type {(import("../ui/dom.js").Child | import("../ui/dom.js").Child[])[]} */ row,
  ) =>
    row.map((cell, i) =>
      i === 0 ? h("th", { scope: "row" }, ...[cell].flat()) : h("td", {}, ...[cell].flat()),
    );
  const element = h(
    "table",
    { id, class: "runs-table" },
    h(
      "thead",
      {},
      h("tr", {}, ...header.map((label) => h("th", { scope: "col" }, ...[label].flat()))),
    ),
    h("tbody", {}, ...rows.map((row) => h("tr", {}, ...cells(row)))),
  );
  return scrollRegion(h("div", { class: "table-scroll" }, element), caption);
}

/**
 * All runs, sorted by the column that is clicked.
 * @param {RunsReport} report
 * @param {{ column: number, down: boolean }} order
 */
function runTable(report, order) {
  const rows = report.groups.flatMap((group) =>
    group.runs.map((run) => ({ group: group.name, objects: group.objects, ...run })),
  );
  /** @typedef {(typeof rows)[number]} Row */
  const objects = report.groups[0]?.objects ?? [];
  /** @type {Column<Row>[]} */
  const columns = [
    { label: "Run", text: ({ name }) => name, value: ({ name }) => name, isText: true },
    { label: "Group", text: ({ group }) => group, value: ({ group }) => group, isText: true },
    {
      label: "Architecture",
      text: ({ architecture }) => architecture,
      value: ({ architecture }) => architecture,
      isText: true,
    },
    {
      label: "Seed",
      text: ({ seed }) => (seed === null ? NONE : String(seed)),
      value: ({ seed }) => seed,
    },
    {
      label: "Epochs",
      text: ({ epochs }) => (epochs === 0 ? NONE : integer(epochs)),
      value: ({ epochs }) => epochs,
    },
    { label: "TC", text: ({ tc }) => fixed(tc), value: ({ tc }) => tc },
    ...objects.map(({ name, threshold }, k) => ({
      label: `Error ${name}`,
      text: (/** @type {Row} */ { errors }) => significant(errors[k]),
      value: (/** @type {Row} */ { errors }) => errors[k],
      isGood: (/** @type {Row} */ { errors }) =>
        errors[k] !== null && Number(errors[k]) <= threshold,
    })),
  ];
  const body = h("tbody");
  const headers = columns.map((column, i) => {
    const button = h(
      "button",
      {
        type: "button",
        class: "sort",
        onclick: () => {
          order.down = order.column === i && !order.down;
          order.column = i;
          sort();
        },
      },
      column.label,
    );
    return h("th", { scope: "col", class: column.isText ? "text" : "" }, button);
  });
  const sort = () => {
    const { value } = columns[order.column] ?? columns[0];
    const compare = (/** @type {Row} */ a, /** @type {Row} */ b) => {
      const [x, y] = [value?.(a) ?? null, value?.(b) ?? null];
      // What has no value is last, whichever way it is sorted.
      if (x === null || y === null) return x === y ? 0 : x === null ? 1 : -1;
      const difference =
        typeof x === "number" && typeof y === "number"
          ? x - y
          : String(x).localeCompare(String(y), "en", { numeric: true });
      return order.down ? -difference : difference;
    };
    const sorted = [...rows].sort(compare);
    headers.forEach((header, i) => {
      if (i === order.column)
        header.setAttribute("aria-sort", order.down ? "descending" : "ascending");
      else header.removeAttribute("aria-sort");
    });
    fill(
      body,
      ...sorted.map((row) =>
        h(
          "tr",
          { data: { run: row.name } },
          ...columns.map(({ text, isText, isGood }, i) =>
            h(
              i === 0 ? "th" : "td",
              {
                class: isText ? "text" : isGood?.(row) ? "good" : "",
                scope: i === 0 ? "row" : null,
              },
              text(row),
            ),
          ),
        ),
      ),
    );
  };
  sort();
  const element = h(
    "table",
    { id: "run-table", class: "runs-table" },
    h("thead", {}, h("tr", {}, ...headers)),
    body,
  );
  return scrollRegion(h("div", { class: "table-scroll tall" }, element), "Runs");
}

/** @param {Figure} figure */
function figureView({ name, caption, svg }) {
  const drawn = new DOMParser().parseFromString(svg, "image/svg+xml").documentElement;
  const picture = document.importNode(drawn, true);
  picture.setAttribute("role", "img");
  picture.setAttribute("aria-label", caption);
  const button = (/** @type {string} */ label, /** @type {() => void} */ onclick) =>
    h(
      "button",
      { type: "button", class: "link", data: { save: `${name}.${label.toLowerCase()}` }, onclick },
      icon("icon-download"),
      label,
      h("span", { class: "visually-hidden" }, ` of ${name}`),
    );
  return h(
    "figure",
    { data: { figure: name } },
    scrollRegion(h("div", { class: "table-scroll" }, picture), name),
    h(
      "figcaption",
      {},
      h("span", {}, caption),
      button("SVG", () => save(`${name}.svg`, "image/svg+xml", svg)),
      button("PNG", async () => save(`${name}.png`, "image/png", await toPng(svg))),
    ),
  );
}

/**
 * A figure as PNG.
 * @param {string} svg
 * @returns {Promise<Blob>}
 */
async function toPng(svg) {
  const url = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
  try {
    const image = new Image();
    image.src = url;
    await image.decode();
    const canvas = h("canvas", {
      width: image.width * PNG_SCALE,
      height: image.height * PNG_SCALE,
    });
    const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    context.drawImage(image, 0, 0, canvas.width, canvas.height);
    return await new Promise((resolve, reject) =>
      canvas.toBlob(
        (blob) =>
          blob ? resolve(blob) : reject(new Error("the browser makes no PNG of the figure")),
        "image/png",
      ),
    );
  } finally {
    URL.revokeObjectURL(url);
  }
}

/**
 * Runs that do not count, with the reason.
 * @param {RunsComparison} comparison
 * @param {RunDataSet | undefined} set
 */
function dropped({ unread }, set) {
  const incomplete = (set?.runs ?? []).filter((run) => run.incomplete);
  const lines = [
    ...incomplete.map(({ name, incomplete }) => ({ name, reason: incomplete })),
    ...unread.map(({ name, reason }) => ({ name, reason })),
  ];
  if (lines.length === 0) return null;
  return h(
    "div",
    { class: "panel", id: "runs-dropped", data: { count: String(lines.length) } },
    h(
      "h3",
      {},
      `${count(lines.length, "run")} that ${lines.length === 1 ? "does" : "do"} not count`,
    ),
    h(
      "ul",
      { class: "dropped" },
      ...lines.map(({ name, reason }) => h("li", {}, h("strong", {}, name), `: ${reason}`)),
    ),
  );
}

/**
 * @param {Compared} compared
 * @param {RunsReport} report
 */
function downloads(compared, report) {
  const item = (
    /** @type {string} */ id,
    /** @type {string} */ label,
    /** @type {() => void} */ onclick,
  ) => h("button", { id, type: "button", class: "button", onclick }, icon("icon-download"), label);
  return h(
    "div",
    { class: "downloads" },
    item("save-runs-html", "Report (HTML)", () =>
      save("report.html", "text/html", compared.toHtml()),
    ),
    item("save-runs-json", "Report (JSON)", () =>
      save("report.json", "application/json", `${JSON.stringify(report, null, 2)}\n`),
    ),
    item("save-runs-csv", "Runs (CSV)", () => save("runs.csv", "text/csv", compared.runsCsv())),
    item("save-errors-csv", "Errors (CSV)", () =>
      save("errors.csv", "text/csv", compared.errorsCsv()),
    ),
  );
}
