// @ts-check
/** The comparison of runs: tables, figures, runs left out, and files to save. */

import { announce, byId, fill, h, icon, notice } from "../ui/dom.js";
import { save } from "../ui/download.js";
import { baseName, count, duration, fixed, integer, significant } from "../ui/format.js";
import { toPng } from "../ui/png.js";
import { scrollRegion } from "../ui/scroll-region.js";
import { setAvailable } from "../ui/tabs.js";
import { inStepView } from "./in-step.js";
import { tableView } from "./tables.js";

/**
 * @typedef {import("./comparison.js").RunsComparison} RunsComparison
 * @typedef {import("../pkg/index.js").Compared} Compared
 * @typedef {import("../pkg/index.js").Figure} Figure
 * @typedef {import("../pkg/index.js").RunDataSet} RunDataSet
 * @typedef {import("../pkg/index.js").RunsReport} RunsReport
 * @typedef {import("../pkg/index.js").Table} Table
 * @typedef {Map<Table["name"], import("./tables.js").Order>} Orders
 */

/** Objects that get a column. */
const LISTED_OBJECTS = 8;

/**
 * @param {import("../session.js").Session} session
 * @param {RunsComparison} comparison
 */
export function showComparison(session, comparison) {
  const place = byId("comparison");
  let told = "";
  /** By what the tables of runs are sorted. @type {Orders} */
  const orders = new Map();
  const inStep = inStepView(session, comparison);

  const rebuild = () => {
    const { agents, dataSets, unread, unscored, pending, reading, error } = comparison;
    const trained = dataSets.reduce((sum, set) => sum + set.runs.length, 0);
    const runs = trained + agents.length + unread.length;
    place.hidden = runs === 0 && unscored.length + pending.length < 2 && !reading && !error;
    setAvailable(byId("view-compare"), !place.hidden);
    if (place.hidden) {
      fill(place);
      Object.assign(place.dataset, { runs: "0", complete: "0", groups: "0" });
      return;
    }
    const set = dataSets[comparison.options.dataSet];
    const report = comparison.compared?.report ?? null;
    const groups = [...(report?.groups ?? []), ...(report?.agents?.groups ?? [])];
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
        (set || agents.length > 0) && settings(comparison),
        ...notices(comparison, set, report),
      ),
      inStep.element,
      detectorsView(comparison.detectors),
      ...(comparison.compared ? compared(comparison.compared, orders) : []),
      dropped(comparison, set),
    );
    inStep.update();
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

/**
 * The detectors with their errors, fitted and held out.
 * @param {import("./detectors.js").Detector[]} detectors
 */
function detectorsView(detectors) {
  if (detectors.length < 2) return null;
  const objects = [
    ...new Set(detectors.flatMap(({ evaluation }) => evaluation.objects.map(({ name }) => name))),
  ].slice(0, LISTED_OBJECTS);
  const head = ["detector", "TC", "held out", ...objects];
  const cell = (/** @type {number | null | undefined} */ fitted, /** @type {typeof fitted} */ beside) =>
    h("td", {}, significant(fitted), h("small", {}, ` ${significant(beside)}`));
  const rows = detectors.map(({ name, evaluation }) => {
    const { tc, held_out: heldOut } = evaluation;
    const beside = tc === null ? null : heldOut?.tc;
    return h(
      "tr",
      { data: { detector: name } },
      h("th", { scope: "row", class: "text" }, baseName(name)),
      h("td", {}, tc === null ? "unknown" : fixed(tc)),
      h("td", {}, beside === null || beside === undefined ? "–" : fixed(beside)),
      ...objects.map((object) =>
        cell(
          evaluation.objects.find((own) => own.name === object)?.error,
          heldOut?.objects.find((own) => own.name === object)?.error,
        ),
      ),
    );
  });
  const table = h(
    "table",
    { id: "detector-table", class: "runs-table" },
    h("thead", {}, h("tr", {}, ...head.map((label) => h("th", { scope: "col" }, label)))),
    h("tbody", {}, ...rows),
  );
  return h(
    "div",
    { class: "panel" },
    h("h3", {}, "Detectors"),
    h("p", { class: "hint-line" }, "Errors on the frames fitted on; small: on held-out sequences."),
    scrollRegion(h("div", { class: "table-scroll" }, table), "Detectors"),
  );
}

/** @param {RunsComparison} comparison */
function settings(comparison) {
  const { dataSets, options } = comparison;
  /** @type {RunDataSet | undefined} */
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
    .../** @type {[string, string][]} */ (
      (set?.settings ?? []).map((name) => [name, `Setting: ${name}`])
    ),
  ];
  const describe = (/** @type {RunDataSet} */ { trained, runs, objects }) =>
    `${count(runs.length, trained ? "training" : "scored detector")} (${objects.join(", ")})`;
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
    set?.trained !== false && select("compare-group", "Group by", groupings, options.groupBy),
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
 * @param {Orders} orders
 */
function compared(compared, orders) {
  const { tables } = compared;
  const isRuns = (/** @type {Table} */ { name }) => name === "runs" || name === "agents";
  const runs = tables.filter(isRuns);
  const others = tables.filter((table) => !isRuns(table));
  return [
    h("div", { class: "panel" }, ...others.flatMap((table) => tableView(table, orders))),
    h(
      "div",
      { class: "panel comparison-figures" },
      ...compared.figures.map((each) => figureView(each)),
    ),
    h(
      "div",
      { class: "panel" },
      ...runs.flatMap((table) => tableView(table, orders)),
      downloads(compared, compared.report),
    ),
  ];
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
 * Runs that do not count, with the reason.
 * @param {RunsComparison} comparison
 * @param {RunDataSet | undefined} set
 */
function dropped({ agents, unread }, set) {
  const incomplete = [...(set?.runs ?? []), ...agents].filter((run) => run.incomplete);
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
  const table = (
    /** @type {string} */ name,
    /** @type {string} */ label,
    /** @type {() => string} */ write,
  ) => item(`save-${name}-csv`, `${label} (CSV)`, () => save(`${name}.csv`, "text/csv", write()));
  const ofRuns = [
    table("runs", "Runs", () => compared.runsCsv()),
    table("errors", "Errors", () => compared.errorsCsv()),
  ];
  const ofAgents = [
    table("agents", "Agents", () => compared.agentsCsv()),
    table("success", "Success", () => compared.successCsv()),
  ];
  return h(
    "div",
    { class: "downloads" },
    item("save-runs-html", "Report (HTML)", () =>
      save("report.html", "text/html", compared.toHtml()),
    ),
    item("save-runs-json", "Report (JSON)", () =>
      save("report.json", "application/json", `${JSON.stringify(report, null, 2)}\n`),
    ),
    ...(report.groups.length > 0 ? ofRuns : []),
    ...(report.agents ? ofAgents : []),
  );
}
