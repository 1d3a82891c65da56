// @ts-check
/** Tracking capability at large, how it was scored, and the switches of that. */

import { fill, h, notice } from "../ui/dom.js";
import { baseName, count, fixed, sentence } from "../ui/format.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../pkg/index.js").Evaluation} Evaluation
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

const FOLDS = [2, 3, 5, 10];

const LISTED_WARNINGS = 2;

const FITTED = "Fitted on the same frames";

const WHAT =
  "TC is the share of objects that some keypoint tracks: the same keypoint in every frame follows " +
  "the object, under one map, with an error e of at most the object’s threshold μ.";

/** @param {number | null} tc `null`: the data cannot tell tracking from chance */
export function tcText(tc) {
  return tc === null ? "unknown" : fixed(tc);
}

/** @param {{ tracked: boolean }[]} objects */
export function tally(objects) {
  return (
    `${objects.filter(({ tracked }) => tracked).length} of ` +
    `${count(objects.length, "object")} tracked`
  );
}

/** @param {Session} session */
export function summaryView(session) {
  const numbers = numbersView(session);
  const protocol = h("p", { class: "protocol" });
  const warnings = h("div", { class: "warnings" });
  const update = () => {
    const { evaluation } = session.score;
    if (!evaluation) return;
    numbers.update();
    protocol.textContent = describeProtocol(session, evaluation);
    const found = (evaluation.findings ?? []).map(({ text }) => sentence(text));
    fill(warnings, ...warningsView([...found, ...evaluation.warnings]));
  };
  const { scoring } = session.score;
  const what = h(
    "details",
    { class: "what" },
    h("summary", {}, "What is this?"),
    h("p", { class: "protocol" }, WHAT),
    protocol,
  );
  const element = h(
    "div",
    { class: "panel score" },
    h("div", { class: "tc" }, ...numbers.elements),
    what,
    h(
      "div",
      { class: "score-more" },
      scoring && transformSwitch(session),
      scoring && protocolSelect(session),
      scoring &&
        h(
          "details",
          { class: "advanced" },
          h("summary", {}, "Advanced"),
          h("div", { class: "settings" }, rankSelect(session), intervalsBox(session)),
        ),
    ),
    savedNotice(session),
    session.origin?.note &&
      h("p", { class: "origin hint-line", title: session.origin.note }, session.origin.note),
  );
  return { element, warnings, update };
}

/** @param {string[]} texts */
function warningsView(texts) {
  const notices = texts.map((text) => notice("warning", text));
  const more = notices.length - LISTED_WARNINGS;
  if (more <= 1) return notices;
  const summary = h("summary", {}, count(more, "more warning"));
  return [
    ...notices.slice(0, LISTED_WARNINGS),
    h("details", {}, summary, ...notices.slice(LISTED_WARNINGS)),
  ];
}

/**
 * TC on the frames that the maps are fitted on beside that on held-out sequences.
 * @param {Session} session
 */
function numbersView({ score }) {
  const spans = (/** @type {string[]} */ ...names) =>
    names.map((name) => h("span", { class: name }));
  const [firstLabel, value] = spans("tc-label", "tc-value");
  const [label, colon, beside, known] = spans(
    "tc-label",
    "visually-hidden",
    "tc-beside",
    "tc-known",
  );
  const share = h("p", { class: "tc-share" });
  const first = h("p", { class: "tc-number" }, firstLabel, value);
  const other = h("p", { class: "tc-number", id: "tc-interval" }, label, colon, beside, known);

  const update = () => {
    const { evaluation, intervals } = score;
    if (!evaluation) return;
    const shown = score.shownHeldOut;
    const tc = evaluation.tc === null ? null : (shown?.tc ?? evaluation.tc);
    const heldOut = evaluation.held_out;
    const labels = [FITTED, `On held-out sequences (${heldOut?.folds} folds)`];
    value.textContent = tcText(tc);
    value.dataset.tc = String(tc);
    firstLabel.textContent = shown ? labels[1] : FITTED;
    for (const each of [label, colon, beside]) each.hidden = !heldOut;
    label.textContent = heldOut ? labels[shown ? 0 : 1] : "";
    colon.textContent = heldOut ? ": " : "";
    const isKnown = evaluation.tc !== null;
    const second = shown ? evaluation.tc : isKnown ? (heldOut?.tc ?? null) : null;
    beside.textContent = heldOut ? tcText(second) : "";
    share.textContent = isKnown
      ? tally(shown?.objects ?? evaluation.objects)
      : "too few frames to tell tracking from chance";
    const ends = (intervals ?? evaluation.intervals)?.tc.map((end) => fixed(end)).join(" – ");
    const drawing = score.resampling.intervals && !ends ? "Drawing the 95 % interval …" : "";
    // The resamples are fitted and scored on the same frames, so their intervals are not those of
    // held-out errors.
    const which = shown || !heldOut ? "" : " of the fitted one";
    fill(known, ends ? `${shown ? ", " : ""}95 % interval${which} ${ends}` : drawing);
    other.hidden = other.textContent === "";
  };
  const title = h("h2", { id: "results-title" }, "Tracking capability");
  const head = h("div", { class: "tc-head" }, title, share);
  return { elements: [head, h("div", { class: "tc-numbers" }, first, other)], update };
}

/**
 * What a saved evaluation cannot show.
 * @param {Session} session
 */
function savedNotice({ score: { saved, savedIn } }) {
  if (!saved || !savedIn) return null;
  const lacks = saved.lacks.length > 0 ? ` It was saved without ${saved.lacks.join(", ")}.` : "";
  return notice(
    "info",
    `Shown as ${baseName(savedIn.path)} has it, which tracklens ${saved.evaluation.version} ` +
      `computed.${lacks} Frames, ` +
      "trajectories and keypoints are in no such file, so nothing can be played or scored " +
      "otherwise: add the images or keypoints " +
      "and the ground truth for that.",
    { class: "saved" },
  );
}

/**
 * @param {Session} session
 * @param {Evaluation} evaluation
 */
function describeProtocol(session, evaluation) {
  const frames = count(evaluation.frames, "frame");
  const size = evaluation.image_size;
  const heldOut = session.score.shownHeldOut;
  const map = heldOut
    ? "The map from keypoint to object and the best keypoint are those of the other sequences, " +
      `in ${heldOut.folds} folds; ` +
      "the errors are on frames they were not fitted on."
    : `The map from keypoint to object is fitted and scored on the same ${frames}, as in the ` +
      "authors’ code.";
  return [
    evaluation.transform === "identity"
      ? `Keypoints are scored as they are, without a fitted map, on ${frames}.`
      : map,
    session.score.isInSpace
      ? "The tracking error e is the mean squared distance in the squared unit of the ground truth."
      : "The tracking error e is the mean squared distance in image coordinates (ndc: −1 to +1 " +
        "across the image).",
    size && `Pixels are those of images of ${size[0]}\u00a0×\u00a0${size[1]}.`,
    evaluation.excluded > 0 &&
      `${count(evaluation.excluded, "frame")} left out: a keypoint is missing or not finite.`,
  ]
    .filter(Boolean)
    .join(" ");
}

/** @param {Session} session */
function transformSwitch(session) {
  return h(
    "fieldset",
    { class: "switch", id: "transform" },
    h("legend", { class: "visually-hidden" }, "Map from keypoint to object"),
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
            checked: session.score.options.transform === transform,
            onchange: () => session.score.setOptions({ transform }),
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
      onchange: () =>
        session.score.setOptions({ rank: /** @type {Evaluation["rank"]} */ (select.value) }),
    },
    ...RANKS.map(([rank, label]) =>
      h("option", { value: rank, selected: session.score.evaluation?.rank === rank }, label),
    ),
  );
  return h(
    "label",
    { class: "field", title: "Which directions of the keypoint’s motion are too small to fit" },
    h("span", {}, "Rank rule"),
    select,
  );
}

/** @param {Session} session */
function protocolSelect(session) {
  const most = session.score.sequences.length;
  const folds = [...new Set(FOLDS.map((folds) => Math.min(folds, most)))].filter(
    (folds) => folds > 1,
  );
  const select = h(
    "select",
    {
      id: "protocol",
      disabled: most < 2,
      onchange: () => session.score.setResampling({ folds: Number(select.value) }),
    },
    h("option", { value: "0", selected: session.score.folds === 0 }, "the same frames"),
    ...folds.map((n) =>
      h(
        "option",
        { value: String(n), selected: session.score.folds === n },
        `held-out sequences, ${n} folds`,
      ),
    ),
  );
  const title =
    most < 2
      ? "Holding sequences out takes at least two of them"
      : "The authors’ code scores the frames that the map is fitted on";
  return h("label", { class: "field", title }, h("span", {}, "on"), select);
}

/** @param {Session} session */
function intervalsBox(session) {
  const box = h("input", {
    type: "checkbox",
    id: "intervals",
    disabled: session.score.sequences.length < 2,
    checked: session.score.resampling.intervals,
    onchange: () => session.score.setResampling({ intervals: box.checked }),
  });
  const title =
    session.score.sequences.length < 2
      ? "Intervals take at least two sequences"
      : "Percentile bootstrap: the sequences are drawn 1000 times with replacement";
  return h("label", { class: "check", title }, box, h("span", {}, "95 % intervals over sequences"));
}
