// @ts-check
/** The score: tracking capability, a card per object, the options of the metric, downloads. */

import { announce, byId, fill, h, icon, notice } from "./dom.js";
import { save } from "./download.js";
import { count, fixed, integer, significant } from "./format.js";

/**
 * @typedef {import("./session.js").Session} Session
 * @typedef {import("./pkg/index.js").Evaluation} Evaluation
 * @typedef {import("./pkg/index.js").ObjectEvaluation} ObjectEvaluation
 */

/** @type {[Evaluation["transform"], string, string][]} */
const TRANSFORMS = [
  ["identity", "Identity", "keypoints as they are"],
  ["scale-translate", "Scale and shift", "per axis"],
  ["affine", "Affine", "the paper’s"],
];

/** @type {[Evaluation["rank"], string][]} */
const RANKS = [
  ["reference", "as the authors’ code"],
  ["centred", "on centred points"],
];

/** The gauge of a card is logarithmic between these errors. */
const GAUGE = { from: 1e-4, to: 1 };

/** @param {Session} session */
export function showResults(session) {
  const place = byId("results");
  /** @type {(() => void)[]} */
  let updates = [];

  const rebuild = () => {
    place.hidden = session.evaluation === null;
    if (!session.scoring || !session.evaluation) {
      fill(place);
      updates = [];
      delete place.dataset.tc;
      return;
    }
    const summary = summaryView(session);
    const cards = session.evaluation.objects.map((_, object) => card(session, object));
    updates = [summary.update, ...cards.map(({ update }) => update)];
    fill(place, ...summary.elements, h("ul", { class: "cards" }, ...cards.map(({ element }) => element)));
    update();
    const { tc, objects } = session.evaluation;
    announce(`Tracking capability ${fixed(tc)}: ${tally(objects)}.`);
  };
  const update = () => {
    place.hidden = session.evaluation === null;
    if (session.evaluation) {
      place.dataset.tc = String(session.evaluation.tc);
      for (const each of updates) each();
    }
  };
  session.addEventListener("scoring", rebuild);
  session.addEventListener("evaluation", () => {
    // Within one change the new points come with their own event.
    if (updates.length > 0) update();
  });
  session.addEventListener("selection", update);
}

/** @param {ObjectEvaluation[]} objects */
function tally(objects) {
  return `${objects.filter(({ tracked }) => tracked).length} of ${count(objects.length, "object")} tracked`;
}

/** @param {Session} session */
function summaryView(session) {
  const value = h("p", { class: "tc-value" });
  const share = h("p", { class: "tc-share" });
  const protocol = h("p", { class: "protocol" });
  const warnings = h("div", { class: "warnings" });

  const update = () => {
    const { evaluation } = session;
    if (!evaluation) return;
    value.textContent = fixed(evaluation.tc);
    share.textContent = tally(evaluation.objects);
    protocol.textContent = describeProtocol(session, evaluation);
    fill(warnings, ...evaluation.warnings.map((text) => notice("warning", text)));
  };

  const elements = [
    h(
      "div",
      { class: "panel score" },
      h("div", { class: "tc" }, h("h2", { id: "results-title" }, "Tracking capability"), value, share),
      h("div", { class: "settings" }, transformSwitch(session), rankSelect(session), downloads(session)),
      protocol,
    ),
    session.origin?.note && notice("info", session.origin.note, { class: "origin" }),
    warnings,
  ];
  return { elements, update };
}

/**
 * @param {Session} session
 * @param {Evaluation} evaluation
 */
function describeProtocol(session, evaluation) {
  const frames = count(evaluation.frames, "frame");
  const size = session.imageSize;
  return [
    evaluation.transform === "identity"
      ? `Keypoints are scored as they are, without a fitted map, on ${frames}.`
      : `The map from keypoint to object is fitted and scored on the same ${frames}, as in the authors’ code.`,
    "The tracking error e is the mean squared distance in image coordinates (ndc: −1 to +1 across the image).",
    size && `Pixels are those of images of ${size[0]}\u00a0×\u00a0${size[1]}.`,
    evaluation.excluded > 0 && `${count(evaluation.excluded, "frame")} with a keypoint that is not finite left out.`,
  ]
    .filter(Boolean)
    .join(" ");
}

/** @param {Session} session */
function transformSwitch(session) {
  return h(
    "fieldset",
    { class: "switch", id: "transform" },
    h("legend", {}, "Map from keypoint to object"),
    h(
      "div",
      { class: "switch-options" },
      ...TRANSFORMS.map(([transform, label, hint]) =>
        h(
          "label",
          { title: hint },
          h("input", {
            type: "radio",
            name: "transform",
            value: transform,
            checked: session.options.transform === transform,
            onchange: () => session.setOptions({ transform }),
          }),
          h("span", {}, label),
        ),
      ),
    ),
  );
}

/** @param {Session} session */
function rankSelect(session) {
  const select = h(
    "select",
    {
      id: "rank",
      onchange: () => session.setOptions({ rank: /** @type {Evaluation["rank"]} */ (select.value) }),
    },
    ...RANKS.map(([rank, label]) => h("option", { value: rank, selected: session.options.rank === rank }, label)),
  );
  return h(
    "label",
    { class: "field", title: "Which directions of the keypoint’s motion are too small to fit" },
    h("span", {}, "Rank rule"),
    select,
  );
}

/** @param {Session} session */
function downloads(session) {
  const item = (/** @type {string} */ id, /** @type {string} */ label, /** @type {() => void} */ onclick) =>
    h("button", { id, type: "button", class: "button", onclick }, icon("icon-download"), label);
  return h(
    "div",
    { class: "downloads" },
    item("save-evaluation", "Evaluation (JSON)", () =>
      save("evaluation.json", "application/json", `${JSON.stringify(session.evaluation, null, 2)}\n`),
    ),
    item("save-keypoints", "Keypoints (CSV)", () => save("keypoints.csv", "text/csv", session.table?.toCsv() ?? "")),
  );
}

/**
 * @param {Session} session
 * @param {number} object
 */
function card(session, object) {
  const name = session.objects[object];
  const verdict = h("p", { class: "verdict" });
  const error = h("span", { class: "error-value" });
  const gauge = gaugeView();
  const best = h("dd");
  const rmse = h("dd");
  const frames = h("dd");
  const outside = h("dd");
  const threshold = thresholdField(session, name);
  const show = h(
    "button",
    {
      type: "button",
      class: "button",
      onclick: () => {
        session.select({ object });
        byId("viewer").scrollIntoView({ block: "nearest" });
      },
    },
    "Show in frames",
    h("span", { class: "visually-hidden" }, `: ${name}`),
  );
  const element = h(
    "li",
    { class: "card panel", data: { object: name } },
    h("div", { class: "card-head" }, h("h3", {}, name), verdict),
    h("p", { class: "error" }, error, h("span", { class: "error-label" }, "tracking error e")),
    gauge.element,
    threshold.element,
    h(
      "dl",
      {},
      h("div", {}, h("dt", {}, "Best keypoint"), best),
      h("div", {}, h("dt", {}, "RMSE"), rmse),
      h("div", {}, h("dt", {}, "Frames, visible"), frames),
      h("div", {}, h("dt", {}, "Outside the image"), outside),
    ),
    show,
  );

  const update = () => {
    const result = session.evaluation?.objects[object];
    if (!result) return;
    const seen = result.error !== null;
    Object.assign(element.dataset, {
      tracked: String(result.tracked),
      error: String(result.error),
      threshold: String(result.threshold),
      keypoint: String(result.best_keypoint),
      rmse: String(result.rmse),
      frames: String(result.frames),
      outside: String(result.outside),
      selected: String(session.selection.object === object),
    });
    verdict.dataset.tracked = seen ? String(result.tracked) : "none";
    const [symbol, text] = !seen
      ? ["icon-none", "Never visible"]
      : result.tracked
        ? ["icon-check", "Tracked"]
        : ["icon-cross", "Not tracked"];
    fill(verdict, icon(symbol), text);
    error.textContent = significant(result.error);
    gauge.update(result.error, result.threshold, result.tracked);
    best.textContent = result.best_keypoint === null ? "–" : `no. ${result.best_keypoint}`;
    rmse.textContent =
      result.rmse_px === null || result.rmse_px === undefined
        ? significant(result.rmse)
        : `${significant(result.rmse)} · ${significant(result.rmse_px)} px`;
    frames.textContent = integer(result.frames);
    outside.textContent = integer(result.outside);
    show.setAttribute("aria-pressed", String(session.selection.object === object));
    threshold.update(result.threshold);
  };
  return { element, update };
}

/**
 * @param {Session} session
 * @param {string} object
 */
function thresholdField(session, object) {
  const id = `threshold-${object}`;
  const input = h("input", {
    id,
    type: "number",
    min: "0",
    step: "0.001",
    inputMode: "decimal",
    "aria-describedby": `${id}-hint`,
    oninput: () => {
      const value = input.valueAsNumber;
      const valid = Number.isFinite(value) && value > 0;
      input.setAttribute("aria-invalid", String(!valid));
      hint.textContent = valid ? "" : "Expected a number above 0.";
      if (valid) session.setThreshold(object, value);
    },
    // Leaving the field with something impossible in it brings back what is in force.
    onblur: () => {
      if (input.getAttribute("aria-invalid") === "true") reset(session.options.thresholds?.[object] ?? null);
    },
  });
  const hint = h("span", { id: `${id}-hint`, class: "hint", role: "status" });
  const button = h("button", { type: "button", class: "link", onclick: () => reset(null) }, "Default");
  const reset = (/** @type {number | null} */ value) => {
    input.setAttribute("aria-invalid", "false");
    hint.textContent = "";
    input.blur();
    session.setThreshold(object, value);
  };
  const update = (/** @type {number} */ threshold) => {
    // What is being typed is not rewritten.
    if (document.activeElement !== input) input.value = String(threshold);
    button.hidden = threshold === session.defaultThresholds[object];
    button.title = `Back to ${session.defaultThresholds[object]}`;
  };
  const element = h(
    "div",
    { class: "threshold" },
    h("label", { for: id }, "Threshold μ"),
    h("span", { class: "threshold-input" }, input, button),
    hint,
  );
  return { element, update };
}

/** An error against its threshold on a logarithmic scale. */
function gaugeView() {
  const svg = "http://www.w3.org/2000/svg";
  const make = (/** @type {string} */ tag, /** @type {Record<string, string>} */ attributes) => {
    const element = document.createElementNS(svg, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    return element;
  };
  const root = make("svg", { class: "gauge", viewBox: "0 0 100 10", preserveAspectRatio: "none", "aria-hidden": "true" });
  const bar = make("rect", { class: "gauge-bar", y: "3", height: "4", x: "0" });
  const tick = make("rect", { class: "gauge-tick", y: "0", height: "10", width: "0.8" });
  root.append(make("rect", { class: "gauge-track", y: "3", height: "4", width: "100" }), bar, tick);

  const position = (/** @type {number} */ error) => {
    const share = Math.log(error / GAUGE.from) / Math.log(GAUGE.to / GAUGE.from);
    return 100 * Math.min(1, Math.max(0, share));
  };
  const element = h(
    "div",
    { class: "gauge-frame", "aria-hidden": "true" },
    root,
    h("div", { class: "gauge-scale" }, h("span", {}, "0.0001"), h("span", {}, "0.01"), h("span", {}, "1")),
  );
  /**
   * @param {number | null} error
   * @param {number} threshold
   * @param {boolean} tracked
   */
  const update = (error, threshold, tracked) => {
    element.dataset.tracked = String(tracked);
    // An error of exactly 0 still shows.
    bar.setAttribute("width", error === null ? "0" : String(Math.max(1, position(error))));
    tick.setAttribute("x", String(position(threshold) - 0.4));
  };
  return { element, update };
}
