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

export class SequencesView {
  #session;
  /** @type {SequenceError[]} */
  #errors = [];
  /** What the errors are of. */
  #key = "";
  #threshold = 0;
  #title = h("h3", { id: "sequences-title" });
  #hint = h("p", { class: "hint-line" });
  #objects = h("select", {
    "aria-label": "Object",
    id: "sequences-object",
    onchange: () => this.#session.score.select({ object: this.#objects.selectedIndex }),
  });
  #sequenceList = h("ol", { class: "worst", id: "worst-sequences" });
  #frameList = h("ol", { class: "worst", id: "worst-frames" });
  #sequencePart = h("div", {}, h("h4", {}, "Worst sequences"), this.#sequenceList);
  #figure = figureView({
    id: "sequences",
    label: "Error of the object in each sequence, the worst one first",
    draw: (theme, width) => this.#draw(theme, width),
  });

  /** @param {Session} session */
  constructor(session) {
    this.#session = session;
    this.#listenToPointer();
    const frames = session.score.scoring ? "Worst frames" : "Their worst frames";
    this.element = h(
      "section",
      { class: "panel", "aria-labelledby": "sequences-title" },
      h("div", { class: "panel-head" }, this.#title, this.#objects),
      this.#hint,
      this.#figure.element,
      h(
        "div",
        { class: "worst-lists" },
        this.#sequencePart,
        h("div", {}, h("h4", {}, frames), this.#frameList),
      ),
    );
  }

  update() {
    const { score } = this.#session;
    const { object } = score.selection;
    const keypoint = score.keypointOf(object);
    const result = score.evaluation?.objects[object];
    const isKnown = score.scoring !== null || score.saved?.evaluation.sequences !== undefined;
    this.element.hidden = !isKnown || keypoint === null || !result;
    if (!isKnown || keypoint === null || !result) {
      this.#key = "";
      return;
    }
    const options = score.objects.map((name, k) => h("option", { selected: k === object }, name));
    fill(this.#objects, ...options);
    this.#objects.hidden = score.objects.length < 2;
    this.#title.textContent = `Where the error of ${result.name} comes from`;
    this.#threshold = result.threshold;
    const key = `${object} ${keypoint} ${score.options.transform} ${score.options.rank}`;
    if (key !== this.#key) {
      this.#key = key;
      this.#list(object, keypoint);
    }
    this.#figure.update();
  }

  /**
   * The worst sequences and frames of an object with a keypoint.
   * @param {number} object
   * @param {number} keypoint
   */
  #list(object, keypoint) {
    const session = this.#session;
    const { score } = session;
    const errors = score.errorsBySequence(object, keypoint);
    const frames = score.worstFrames(object, keypoint, SHOWN);
    this.#errors = errors;
    fill(
      this.#sequenceList,
      ...errors.slice(0, SHOWN).map((worst) => sequenceItem(session, worst)),
    );
    fill(this.#frameList, ...frames.map((worst) => frameItem(session, worst)));
    this.#sequencePart.hidden = errors.length < 2;
    const unit = score.isInSpace ? "" : " (ndc)";
    this.#hint.textContent =
      errors.length < 2
        ? `With keypoint ${keypoint}; the squared distance${unit} in the worst frames.`
        : `With keypoint ${keypoint}, in ${count(errors.length, "sequence")}, the worst one ` +
          "first; dashed: the threshold. " +
          (score.scoring ? "Choose one to see its worst frame." : "");
  }

  /**
   * @param {import("../pkg/index.js").Theme | undefined} theme
   * @param {number} width
   */
  #draw(theme, width) {
    const errors = this.#errors;
    if (errors.length < 2) return null;
    const { frame } = this.#session.score.selection;
    const selected = errors.findIndex(
      ({ start, length }) => frame >= start && frame < start + length,
    );
    const marked = theme && selected >= 0 ? selected : undefined;
    const bars = Float64Array.from(errors, ({ error }) => error);
    return sequencesFigure(bars, this.#threshold, marked, theme, width);
  }

  #listenToPointer() {
    const { layer, showTip } = this.#figure;
    const { score } = this.#session;
    layer.addEventListener("pointermove", (event) => {
      const found = this.#under(event);
      layer.dataset.active = String(found !== null && score.scoring !== null);
      if (!found) {
        showTip(null);
        return;
      }
      const { sequence, error } = found.worst;
      showTip(`${sequence}: error ${significant(error)}`, found.x, found.y);
    });
    layer.addEventListener("pointerleave", () => showTip(null));
    layer.addEventListener("click", (event) => {
      const found = this.#under(event);
      if (found && score.scoring) show(this.#session, found.worst.worst);
    });
  }

  /**
   * The sequence whose bar is under a pointer, and where the bar ends.
   * @param {MouseEvent} event
   */
  #under(event) {
    const drawn = this.#figure.drawing();
    const errors = this.#errors;
    if (!drawn) return null;
    const [left, top, width, height] = drawn.plot;
    const box = this.#figure.layer.getBoundingClientRect();
    const position = Math.floor(((event.clientX - box.left - left) / width) * errors.length);
    if (!errors[position]) return null;
    const share = Math.log(errors[position].error / drawn.y[0]) / Math.log(drawn.y[1] / drawn.y[0]);
    const x = left + ((position + 0.5) / errors.length) * width;
    return { worst: errors[position], x, y: top + (1 - Math.min(1, Math.max(0, share))) * height };
  }
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
