// @ts-check
/** One object: tracked or not, by how much, by which keypoint, under which map, in which frames. */

import { fill, h, icon } from "../ui/dom.js";
import { integer, significant } from "../ui/format.js";
import { objectColor } from "../ui/palette.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../pkg/index.js").ObjectEvaluation} ObjectEvaluation
 */

/** The gauge of a card is logarithmic between these errors; in space, these shares of the threshold. */
const GAUGE = {
  image: { from: 1e-4, to: 1, title: "The error from 0.0001 to 1" },
  space: {
    from: 1e-2,
    to: 1e2,
    title: "The error from a hundredth to a hundred times the threshold",
  },
};

/**
 * @param {Session} session
 * @param {number} object
 */
export function card(session, object) {
  const { score } = session;
  const name = score.evaluation?.objects[object].name ?? "";
  const verdict = h("p", { class: "verdict" });
  const numbers = numbersView(session, object);
  const interval = h("p", { class: "error-interval" });
  const gauge = gaugeView(score.isInSpace);
  const facts = h("dl");
  const map = h("div", { class: "map" });
  const mapDetails = h("details", { class: "map-details" }, h("summary", {}, "Fitted map"), map);
  const threshold = score.scoring ? thresholdField(session, name) : null;
  const title = titleView(session, object, name);
  const more = h("summary", {}, "Details", h("span", { class: "visually-hidden" }, ` of ${name}`));
  const element = h(
    "li",
    { class: "card", data: { object: name } },
    h("div", { class: "card-row" }, title, verdict, ...numbers.elements, threshold?.element),
    h(
      "div",
      { class: "card-foot" },
      gauge.element,
      h("details", { class: "card-more" }, more, interval, facts, mapDetails),
    ),
  );

  const update = () => {
    const { evaluation } = score;
    const result = evaluation?.objects[object];
    if (!evaluation || !result) return;
    const heldOut = score.shownHeldOut?.objects[object];
    const shown = heldOut ?? result;
    const isSelected = score.scoring !== null && score.selection.object === object;
    Object.assign(element.dataset, dataOf(result), {
      heldOut: String(heldOut?.error ?? ""),
      selected: String(isSelected),
    });
    showVerdict(verdict, shown, result, isJudged(evaluation, object));
    numbers.update();
    const known = intervalOf(session, object);
    interval.hidden = !known || heldOut !== undefined;
    interval.textContent = known ? `95 % interval ${known}` : "";
    gauge.update(shown.error, result.threshold, shown.tracked, result.second_best?.error ?? null);
    fill(facts, ...factsOf(session, object, result));
    mapDetails.hidden = !result.map || evaluation.transform === "identity";
    fill(map, ...(result.map ? equations(result.map) : []));
    title.querySelector("button")?.setAttribute("aria-pressed", String(isSelected));
    threshold?.update(result.threshold);
  };
  return { element, update };
}

/** @param {ObjectEvaluation} result */
function dataOf(result) {
  return {
    tracked: String(result.tracked),
    error: String(result.error),
    threshold: String(result.threshold),
    keypoint: String(result.best_keypoint),
    rmse: String(result.rmse),
    frames: String(result.frames),
    outside: String(result.outside),
  };
}

/**
 * The name of the object, which shows it in the frames and plots.
 * @param {Session} session
 * @param {number} object
 * @param {string} name
 */
function titleView(session, object, name) {
  const swatch = h("span", { class: "object-swatch", "aria-hidden": "true" });
  swatch.style.background = objectColor(object);
  if (!session.score.scoring) return h("h3", { class: "card-name" }, name);
  const show = h(
    "button",
    {
      type: "button",
      class: "card-show",
      title: "Show in the plots",
      onclick: () => session.score.select({ object }),
    },
    name,
  );
  return h("h3", { class: "card-name" }, swatch, show);
}

/**
 * Whether the frames are enough to tell whether an object is tracked.
 * @param {import("../pkg/index.js").Evaluation} evaluation
 * @param {number} object
 */
export function isJudged(evaluation, object) {
  return evaluation.sufficiency?.[object]?.known ?? true;
}

/**
 * @param {HTMLElement} verdict
 * @param {{ error: number | null, tracked: boolean }} shown
 * @param {ObjectEvaluation} result
 * @param {boolean} isKnown whether the frames are enough to tell tracking from chance
 */
function showVerdict(verdict, shown, result, isKnown) {
  const isSeen = shown.error !== null && isKnown;
  const notScored = isKnown ? "Not scored" : "Too few frames";
  const unseen = result.error === null ? "Never visible" : notScored;
  verdict.dataset.tracked = isSeen ? String(shown.tracked) : "none";
  const [symbol, text] = !isSeen
    ? ["icon-none", unseen]
    : shown.tracked
      ? ["icon-check", "Tracked"]
      : ["icon-cross", "Not tracked"];
  fill(verdict, icon(symbol), text);
}

/**
 * The errors of an object, fitted and held out, and its best keypoint.
 * @param {Session} session
 * @param {number} object
 */
function numbersView({ score }, object) {
  const number = (/** @type {string} */ className) => {
    const value = h("span", { class: className });
    const label = h("span", { class: "error-label" });
    return { value, label, element: h("p", { class: "error" }, value, label) };
  };
  const [first, second, third] = ["error-value", "error-beside", "error-keypoint"].map(number);
  const update = () => {
    const result = score.evaluation?.objects[object];
    if (!result) return;
    const beside = score.evaluation?.held_out?.objects[object];
    const shown = score.shownHeldOut?.objects[object];
    const labels = ["tracking error e", "held out"];
    first.value.textContent = significant((shown ?? result).error);
    first.label.textContent = labels[shown ? 1 : 0];
    second.element.hidden = !beside;
    second.value.textContent = significant((shown ? result : beside)?.error);
    second.label.textContent = labels[shown ? 0 : 1];
    const { best_keypoint: best, rmse_px: pixels } = result;
    third.value.textContent = best === null ? "–" : `no. ${best}`;
    third.label.textContent = pixels ? `keypoint, ${significant(pixels)} px` : "keypoint";
  };
  return { elements: [first, second, third].map(({ element }) => element), update };
}

/**
 * The 95 % interval of the error on the frames that are fitted on.
 * @param {Session} session
 * @param {number} object
 */
function intervalOf({ score: { intervals, evaluation } }, object) {
  const ends = (intervals ?? evaluation?.intervals)?.objects[object]?.error;
  return ends ? ends.map((end) => significant(end)).join(" – ") : null;
}

/**
 * @param {Session} session
 * @param {number} object
 * @param {ObjectEvaluation} result
 */
function factsOf(session, object, result) {
  const { evaluation } = session.score;
  const best = result.best_keypoint;
  const second = result.second_best;
  const displayed = session.score.keypointOf(object);
  const pixels = result.rmse_px;
  const total = evaluation?.frames ?? result.frames;
  const left = [
    total > result.frames && `${integer(total - result.frames)} not visible`,
    (evaluation?.excluded ?? 0) > 0 && `${integer(evaluation?.excluded ?? 0)} not finite`,
  ].filter(Boolean);
  const fact = (
    /** @type {string} */ term,
    /** @type {import("../ui/dom.js").Child[]} */ ...text
  ) => h("div", {}, h("dt", {}, term), h("dd", {}, ...text));
  const look = (/** @type {number} */ keypoint) =>
    h(
      "button",
      {
        type: "button",
        class: "link",
        disabled: !session.score.scoring,
        "aria-label": `Show ${result.name} with keypoint no. ${keypoint}`,
        onclick: () => session.score.choose(object, keypoint === best ? null : keypoint),
      },
      `no. ${keypoint}`,
    );
  const interval = intervalOf(session, object);
  const { shownHeldOut } = session.score;
  const beside = !shownHeldOut && evaluation?.held_out?.objects[object];
  return [
    shownHeldOut && fact("Fitted on the same frames", significant(result.error)),
    shownHeldOut && interval && fact("95 % interval there", interval),
    beside && fact("On held-out sequences", significant(beside.error)),
    fact("Best keypoint", best === null ? "–" : `no. ${best}`),
    second && fact("Second best", look(second.keypoint), ` ${significant(second.error)}`),
    displayed !== null &&
      displayed !== best &&
      fact("On display", `no. ${displayed} · `, backToBest(session, object)),
    fact(
      "RMSE",
      pixels === null || pixels === undefined
        ? significant(result.rmse)
        : `${significant(result.rmse)} · ${significant(pixels)} px`,
    ),
    fact("Frames used", `${integer(result.frames)} of ${integer(total)}`),
    left.length > 0 && fact("Left out", left.join(", ")),
    result.outside > 0 && fact("Outside the image", `${integer(result.outside)} (included)`),
  ];
}

/**
 * @param {Session} session
 * @param {number} object
 */
function backToBest(session, object) {
  return h(
    "button",
    { type: "button", class: "link", onclick: () => session.score.choose(object, null) },
    "back to the best",
  );
}

/**
 * A map as an equation a coordinate.
 * @param {NonNullable<ObjectEvaluation["map"]>} map
 */
function equations({ a, b }) {
  const part = (/** @type {number} */ value) => Math.abs(value).toFixed(3);
  const sign = (/** @type {number} */ value) => (value < 0 ? "−" : "+");
  const rows = a.map((factors, i) => {
    const terms = factors.map((factor, j) => `${sign(factor)} ${part(factor)} ${"uvw"[j]}`);
    const sum = [...terms, `${sign(b[i])} ${part(b[i])}`].join(" ");
    return `${"xyz"[i]} = ${sum.replace(/^\+ /, "").replace(/^− /, "−")}`;
  });
  const [keypoint, object] = [a[0].length, a.length];
  const units = keypoint === 2 && object === 2 ? "both in ndc" : "in the units of their tables";
  const [of, to] = ["uvw".slice(0, keypoint), "xyz".slice(0, object)];
  const names = [of, to].map((letters) => `(${[...letters].join(", ")})`);
  return [
    ...rows.map((row) => h("p", {}, h("code", {}, row))),
    h("p", { class: "hint-line" }, `${names[0]} is the keypoint, ${names[1]} the object, ${units}`),
  ];
}

/**
 * @param {Session} session
 * @param {string} object
 */
function thresholdField(session, object) {
  const id = `threshold-${object}`;
  let inForce = NaN;
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
      hint.textContent = valid ? "" : `Expected a number above 0; ${inForce} still holds.`;
      if (valid) session.score.setThreshold(object, value);
    },
    // Leaving the field with something impossible in it brings back what is in force.
    onblur: () => {
      if (input.getAttribute("aria-invalid") === "true")
        reset(session.score.options.thresholds.get(object) ?? null);
    },
  });
  const hint = h("span", { id: `${id}-hint`, class: "hint", role: "status" });
  const button = h(
    "button",
    { type: "button", class: "link", onclick: () => reset(null) },
    "Default",
  );
  const reset = (/** @type {number | null} */ value) => {
    input.setAttribute("aria-invalid", "false");
    hint.textContent = "";
    input.blur();
    session.score.setThreshold(object, value);
  };
  const update = (/** @type {number} */ threshold) => {
    inForce = threshold;
    // What is being typed is not rewritten.
    if (document.activeElement !== input) input.value = String(threshold);
    button.hidden = threshold === session.score.defaultThresholds.get(object);
    button.title = `Back to ${session.score.defaultThresholds.get(object)}`;
  };
  const element = h(
    "div",
    { class: "threshold" },
    h("label", { for: id }, h("span", { class: "visually-hidden" }, "Threshold "), "μ"),
    h("span", { class: "threshold-input" }, input, button),
    hint,
  );
  return { element, update };
}

/**
 * An error against its threshold on a logarithmic scale.
 * @param {boolean} isInSpace whether the scale goes with the threshold
 */
function gaugeView(isInSpace) {
  const { from, to, title } = isInSpace ? GAUGE.space : GAUGE.image;
  const svg = "http://www.w3.org/2000/svg";
  const make = (/** @type {string} */ tag, /** @type {Record<string, string>} */ attributes) => {
    const element = document.createElementNS(svg, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    return element;
  };
  const root = make("svg", {
    class: "gauge",
    viewBox: "0 0 100 10",
    preserveAspectRatio: "none",
    "aria-hidden": "true",
  });
  const bar = make("rect", { class: "gauge-bar", y: "3", height: "4", x: "0" });
  const tick = make("rect", { class: "gauge-tick", y: "0", height: "10", width: "0.8" });
  const second = make("rect", { class: "gauge-second", y: "3", height: "4", width: "0.6" });
  root.append(
    make("rect", { class: "gauge-track", y: "3", height: "4", width: "100" }),
    bar,
    second,
    tick,
  );

  const hint = `${title}, with the threshold and the second best keypoint`;
  const element = h("div", { class: "gauge-frame", "aria-hidden": "true", title: hint }, root);
  /**
   * @param {number | null} error
   * @param {number} threshold
   * @param {boolean} tracked
   * @param {number | null} runnerUp the error of the second best keypoint
   */
  const update = (error, threshold, tracked, runnerUp) => {
    const position = (/** @type {number} */ value) => {
      const share = Math.log(value / (isInSpace ? threshold : 1) / from) / Math.log(to / from);
      return 100 * Math.min(1, Math.max(0, share));
    };
    element.dataset.tracked = String(tracked);
    // An error of exactly 0 still shows.
    bar.setAttribute("width", error === null ? "0" : String(Math.max(1, position(error))));
    tick.setAttribute("x", String(position(threshold) - 0.4));
    second.setAttribute("width", runnerUp === null ? "0" : "0.6");
    second.setAttribute("x", String(position(runnerUp ?? 1) - 0.3));
  };
  return { element, update };
}
