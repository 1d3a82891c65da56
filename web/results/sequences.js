// @ts-check
/**
 * Where the error of an object comes from: its sequences and frames, the worst ones first, and a
 * way to each.
 */

import { sequencesFigure } from "../pkg/index.js";
import { byId, fill, h } from "../ui/dom.js";
import { count, integer, significant } from "../ui/format.js";
import { figureView } from "./figure.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../pkg/index.js").SequenceError} SequenceError
 */

const SHOWN = 6;

/** @param {Session} session */
export function sequencesView(session) {
  /** @type {SequenceError[]} */
  let errors = [];
  /** What `errors` are of. */
  let key = "";
  let threshold = 0;

  const title = h("h3", { id: "sequences-title" });
  const objects = h("select", {
    "aria-label": "Object",
    id: "sequences-object",
    onchange: () => session.score.select({ object: objects.selectedIndex }),
  });
  const sequenceList = h("ol", { class: "worst", id: "worst-sequences" });
  const frameList = h("ol", { class: "worst", id: "worst-frames" });
  const sequencePart = h("div", {}, h("h4", {}, "Worst sequences"), sequenceList);
  const figure = figureView({
    id: "sequences",
    label: "Error of the object in each sequence, the worst one first",
    draw: (theme, width) => {
      if (errors.length < 2) return null;
      const { frame } = session.score.selection;
      const selected = errors.findIndex(
        ({ start, length }) => frame >= start && frame < start + length,
      );
      const marked = theme && selected >= 0 ? selected : undefined;
      return sequencesFigure(
        Float64Array.from(errors, ({ error }) => error),
        threshold,
        marked,
        theme,
        width,
      );
    },
  });
  const under = (/** @type {MouseEvent} */ event) => {
    const drawn = figure.drawing();
    if (!drawn) return null;
    const [left, top, width, height] = drawn.plot;
    const box = figure.layer.getBoundingClientRect();
    const position = Math.floor(((event.clientX - box.left - left) / width) * errors.length);
    if (!errors[position]) return null;
    const share = Math.log(errors[position].error / drawn.y[0]) / Math.log(drawn.y[1] / drawn.y[0]);
    const x = left + ((position + 0.5) / errors.length) * width;
    return { worst: errors[position], x, y: top + (1 - Math.min(1, Math.max(0, share))) * height };
  };
  figure.layer.addEventListener("pointermove", (event) => {
    const found = under(event);
    figure.layer.dataset.active = String(found !== null && session.score.scoring !== null);
    if (found)
      figure.showTip(
        `${found.worst.sequence}: error ${significant(found.worst.error)}`,
        found.x,
        found.y,
      );
    else figure.showTip(null);
  });
  figure.layer.addEventListener("pointerleave", () => figure.showTip(null));
  figure.layer.addEventListener("click", (event) => {
    const found = under(event);
    if (found && session.score.scoring) show(session, found.worst.worst);
  });

  const update = () => {
    const { object } = session.score.selection;
    const keypoint = session.score.keypointOf(object);
    const result = session.score.evaluation?.objects[object];
    const isKnown =
      session.score.scoring !== null || session.score.saved?.evaluation.sequences !== undefined;
    element.hidden = !isKnown || keypoint === null || !result;
    if (!isKnown || keypoint === null || !result) {
      key = "";
      return;
    }
    fill(
      objects,
      ...session.score.objects.map((name, k) => h("option", { selected: k === object }, name)),
    );
    objects.hidden = session.score.objects.length < 2;
    title.textContent = `Where the error of ${result.name} comes from`;
    threshold = result.threshold;
    const now =
      `${object} ${keypoint} ${session.score.options.transform} ` + `${session.score.options.rank}`;
    if (now !== key) {
      key = now;
      errors = session.score.errorsBySequence(object, keypoint);
      fill(sequenceList, ...errors.slice(0, SHOWN).map((worst) => sequenceItem(session, worst)));
      fill(
        frameList,
        ...session.score
          .worstFrames(object, keypoint, SHOWN)
          .map((worst) => frameItem(session, worst)),
      );
      sequencePart.hidden = errors.length < 2;
      hint.textContent =
        errors.length < 2
          ? `With keypoint ${keypoint}; the squared distance (ndc) in the worst frames.`
          : `With keypoint ${keypoint}, in ${count(errors.length, "sequence")}, the worst one ` +
            "first; dashed: the threshold. " +
            (session.score.scoring ? "Choose one to see its worst frame." : "");
    }
    figure.update();
  };
  const hint = h("p", { class: "hint-line" });
  const element = h(
    "section",
    { class: "panel", "aria-labelledby": "sequences-title" },
    h("div", { class: "panel-head" }, title, objects),
    hint,
    figure.element,
    h(
      "div",
      { class: "worst-lists" },
      sequencePart,
      h(
        "div",
        {},
        h("h4", {}, session.score.scoring ? "Worst frames" : "Their worst frames"),
        frameList,
      ),
    ),
  );
  return { element, update, reset: () => (key = "") };
}

/**
 * @param {Session} session
 * @param {SequenceError} worst
 */
function sequenceItem(session, { sequence, worst, worstFrame, error }) {
  return item(session, sequence, worst, error, `To its worst frame, ${worstFrame}`);
}

/**
 * @param {Session} session
 * @param {{ position: number, sequence: string, frame: number, distance: number }} worst
 */
function frameItem(session, { position, sequence, frame, distance }) {
  return item(session, `${sequence}, frame ${integer(frame)}`, position, distance);
}

/**
 * A line with the way to a frame, where it is at hand.
 * @param {Session} session
 * @param {string} text
 * @param {number} position of the frame, negative where it is not
 * @param {number} error
 * @param {string} [title]
 */
function item(session, text, position, error, title) {
  const data = { frame: position };
  const onclick = () => show(session, position);
  return h(
    "li",
    {},
    position < 0
      ? h("span", {}, text)
      : h("button", { type: "button", class: "link", title, data, onclick }, text),
    h("span", { class: "worst-error" }, significant(error)),
  );
}

/**
 * @param {Session} session
 * @param {number} frame
 */
function show(session, frame) {
  session.score.select({ frame });
  byId("stage").scrollIntoView({ block: "nearest" });
}
