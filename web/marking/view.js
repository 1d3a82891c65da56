// @ts-check
/** What is seen of the marking: the frame with its controls, the objects, how far it is. */

import { LEAST_MARKED, markedText } from "../files/texts.js";
import { announce, byId, fill, h, icon } from "../ui/dom.js";
import { save } from "../ui/download.js";
import { count, integer } from "../ui/format.js";
import { keysView, listenToKeys } from "../ui/keys.js";
import { objectColor } from "../ui/palette.js";
import { zoomView } from "../viewer/zoom-view.js";
import { MarkingStage } from "./stage.js";

/** @typedef {import("./marking.js").Marking} Marking */

const KEYS = [
  ["← →", "one frame, ten with Shift"],
  ["N", "next frame to mark"],
  ["↑ ↓ or 1 to 9", "another object"],
  ["X", "not visible in this frame"],
  ["M", "mark the middle of what is shown"],
  ["Delete", "take the mark away"],
  ["U, Ctrl Z", "undo"],
  ["R, Ctrl Y", "redo"],
  ["+ − 0", "zoom in, zoom out, all of the image"],
  ["W A S D", "move the zoomed image"],
];
const POINTER =
  "A click marks the object at hand. Wheel or two fingers zoom, a drag moves the zoomed image.";
const FAR = 10;
const LOST =
  "This browser keeps nothing between visits here: save the table before you leave the page.";

export class MarkingView {
  #marking;
  #place = byId("marking");
  #stage;
  #prompt = h("p", { id: "marking-prompt", class: "marking-prompt", role: "status" });
  #chips = h("div", { class: "legend", role: "group", "aria-label": "Object that a click marks" });
  #scrubber;
  #position = h("output", { id: "marking-position", class: "position", for: "marking-scrubber" });
  #hidden;
  #undo;
  #redo;
  #list = h("ul", { class: "marking-objects" });
  #progress = h("progress", { id: "marking-progress", "aria-labelledby": "marking-count" });
  #count = h("p", { id: "marking-count" });
  #lack = h("p", { class: "viewer-note" });
  #save;

  /** @param {Marking} marking */
  constructor(marking) {
    this.#marking = marking;
    this.#stage = new MarkingStage((point) => marking.place(point));
    this.#scrubber = h("input", {
      id: "marking-scrubber",
      type: "range",
      min: "0",
      step: "1",
      "aria-label": "Frame",
      oninput: () => marking.goTo(this.#scrubber.valueAsNumber),
    });
    this.#hidden = button("marking-hidden", "Not visible", () => marking.hide());
    this.#undo = button("marking-undo", "Undo", () => marking.undo());
    this.#redo = button("marking-redo", "Redo", () => marking.redo());
    this.#save = button("marking-save", "Save the table (CSV)", () =>
      save("marked.csv", "text/csv", marking.csv),
    );
    fill(this.#place, this.#stageView(), this.#sideView());
    listenToKeys(this.#place, (event) => this.#key(event) || this.#stage.gesture.key(event.key));
    this.#place.addEventListener("keydown", (event) => this.#listenToUndo(event));
  }

  open() {
    this.#place.hidden = false;
    this.update();
    this.#place.firstElementChild?.scrollIntoView({ block: "nearest" });
    this.#stage.canvas.focus({ preventScroll: true });
  }

  close() {
    if (this.#place.hidden) return;
    this.#place.hidden = true;
    this.#stage.clear();
    announce("Marking was closed; the marks are kept.");
  }

  /** Whether the frame on display is the one that a mark would be of. */
  get isCurrent() {
    return this.#stage.isCurrent;
  }

  /** Shows other images. */
  renew() {
    this.#stage.clear();
    this.#stage.gesture.reset();
  }

  update() {
    if (this.#place.hidden || !this.#marking.frame) return;
    this.#showFrame();
    this.#showChips();
    this.#showObjects();
    this.#showProgress();
  }

  // What is there

  #stageView() {
    const title = h("h2", { id: "marking-title" }, "Mark objects");
    const head = h("div", { class: "viewer-head" }, title, zoomView(this.#stage.gesture));
    const marking = this.#marking;
    const step = (
      /** @type {string} */ symbol,
      /** @type {string} */ label,
      /** @type {number} */ by,
    ) => {
      const names = { "aria-label": label, title: label };
      const onclick = () => marking.step(by);
      return h(
        "button",
        { type: "button", class: "button round", ...names, onclick },
        icon(symbol),
      );
    };
    const transport = h(
      "div",
      { class: "transport" },
      h(
        "div",
        { class: "transport-buttons" },
        step("icon-back", "Frame before (←)", -1),
        step("icon-forward", "Next frame (→)", 1),
      ),
      this.#scrubber,
      this.#position,
    );
    const next = button("marking-next", "Next frame to mark", () => marking.goOn());
    const actions = [this.#hidden, this.#undo, this.#redo, next];
    return h(
      "div",
      { class: "panel viewer-stage" },
      ...[head, this.#prompt, this.#chips, this.#stage.canvas],
      ...[h("div", { class: "instead-actions" }, ...actions), transport],
    );
  }

  #sideView() {
    const marking = this.#marking;
    const removeAll = () => {
      marking.marks.removeAll(marking.frame.key);
      announce("All marks were removed. Undo brings them back.");
    };
    const done = button("marking-done", "Done", () => {
      marking.close();
      byId("files-title").focus({ preventScroll: true });
    });
    done.dataset.kind = "primary";
    const summary = h("summary", {}, "Keys");
    const isRoomy = window.matchMedia("(min-width: 56rem)").matches;
    const help = [summary, keysView(KEYS), h("p", {}, POINTER)];
    const keys = h("details", { class: "keys", open: isRoomy }, ...help);
    return h(
      "div",
      { class: "panel instead-side" },
      h("div", { class: "marking-progress" }, this.#count, this.#progress, this.#lack),
      h("h3", {}, "Objects"),
      this.#list,
      button("marking-add", "Add an object", () => {
        marking.addObject();
        this.#nameOf(marking.object)?.select();
      }),
      h(
        "div",
        { class: "instead-actions" },
        ...[done, this.#save, button("marking-clear", "Remove all marks", removeAll)],
      ),
      keys,
    );
  }

  // What is shown of it

  #showFrame() {
    const { frame, frames, at, object, marks } = this.#marking;
    const ofFrame = marks.of(frame.key);
    const name = marks.objects[object];
    const where = `Frame ${frame.number} of sequence ${frame.sequence}`;
    const said = ofFrame.map((mark, i) => {
      const state = mark === null ? "not marked" : mark === "hidden" ? "not visible" : "marked";
      return `${marks.objects[i]} ${state}`;
    });
    const label = `${where}: ${said.join(", ")}`;
    this.#stage.show({ source: frame.source, marks: ofFrame, object, label });
    const next = frames[at + 1];
    if (next) this.#stage.prepare(next.source);
    this.#scrubber.max = String(frames.length - 1);
    this.#scrubber.value = String(at);
    this.#scrubber.setAttribute("aria-valuetext", `${where}, ${at + 1} of ${frames.length}`);
    this.#position.textContent = `frame ${integer(frame.number)}`;
    this.#position.title = `${frame.sequence}, ${integer(at + 1)} of ${count(frames.length, "frame")}`;
    const isHidden = ofFrame[object] === "hidden";
    this.#hidden.setAttribute("aria-pressed", String(isHidden));
    const rest = isHidden
      ? "is marked as not visible here."
      : ofFrame[object] === null
        ? ": click its centre."
        : "is marked; a click moves the mark.";
    const prompt = `${frame.sequence}, frame ${integer(frame.number)}. `;
    const isColon = rest.startsWith(":");
    const text = `${prompt}${name}${isColon ? "" : " "}${rest}`;
    if (this.#prompt.textContent === text) return;
    fill(this.#prompt, prompt, h("strong", {}, name), isColon ? rest : ` ${rest}`);
  }

  #showChips() {
    const { marks, object, frame } = this.#marking;
    const ofFrame = marks.of(frame.key);
    const chips = marks.objects.map((name, i) => {
      const chip = h(
        "button",
        {
          type: "button",
          class: "layer",
          "aria-pressed": String(i === object),
          data: { object: String(i) },
          onclick: () => this.#marking.choose(i),
        },
        icon("mark-truth", "mark"),
        name,
        ofFrame[i] !== null && icon("icon-check"),
        ofFrame[i] !== null &&
          h(
            "span",
            { class: "visually-hidden" },
            ofFrame[i] === "hidden" ? ", not visible" : ", marked",
          ),
      );
      chip.style.setProperty("--mark", objectColor(i));
      return chip;
    });
    const focused = focusedAt(this.#chips);
    fill(this.#chips, ...chips);
    chips[focused]?.focus({ preventScroll: true });
  }

  #showObjects() {
    const { objects } = this.#marking.marks;
    const shown = objects.join("\n");
    if (this.#list.dataset.shown === shown) return;
    this.#list.dataset.shown = shown;
    fill(this.#list, ...objects.map((name, i) => this.#objectView(name, i, objects.length)));
  }

  /**
   * @param {string} name
   * @param {number} object
   * @param {number} objects
   */
  #objectView(name, object, objects) {
    const marking = this.#marking;
    const hint = h("span", { class: "hint", role: "status" });
    const field = h("input", {
      class: "row-name",
      value: name,
      "aria-label": `Name of ${name}`,
      onchange: () => {
        hint.textContent = marking.rename(object, field.value.trim());
        field.setAttribute("aria-invalid", String(hint.textContent !== ""));
      },
    });
    const label = `Remove ${name} with its marks`;
    const remove = () => {
      marking.removeObject(object);
      announce(`${name} was removed. Undo brings it back.`);
      this.#nameOf(marking.object)?.focus();
    };
    const removal = { class: "icon-button", "aria-label": label, title: label, onclick: remove };
    const dot = icon("mark-truth", "mark");
    dot.style.setProperty("--mark", objectColor(object));
    return h(
      "li",
      {},
      dot,
      field,
      objects > 1 && h("button", { type: "button", ...removal }, icon("icon-cross")),
      hint,
    );
  }

  /** @param {number} object */
  #nameOf(object) {
    return /** @type {HTMLInputElement | undefined} */ (
      this.#list.querySelectorAll("input")[object]
    );
  }

  #showProgress() {
    const { done, marks, isKept } = this.#marking;
    this.#count.textContent = markedText(done);
    Object.assign(this.#progress, { max: LEAST_MARKED, value: Math.min(done, LEAST_MARKED) });
    const text = [lackOf(this.#marking), !isKept && LOST].filter(Boolean).join(" ");
    if (this.#lack.textContent !== text) this.#lack.textContent = text;
    this.#undo.disabled = !marks.canUndo;
    this.#redo.disabled = !marks.canRedo;
    this.#save.disabled = marks.state.frames.size === 0;
    this.#place.dataset.done = String(done);
  }

  // Keys

  /** @param {KeyboardEvent} event */
  #key({ key, shiftKey }) {
    const marking = this.#marking;
    const far = shiftKey ? FAR : 1;
    const number = Number(key);
    /** @type {Record<string, () => void>} */
    const actions = {
      ArrowRight: () => marking.step(far),
      ArrowLeft: () => marking.step(-far),
      ArrowDown: () => marking.choose(marking.object + 1),
      ArrowUp: () => marking.choose(marking.object - 1),
      n: () => marking.goOn(),
      x: () => marking.hide(),
      m: () => marking.place(this.#stage.middle),
      u: () => marking.undo(),
      r: () => marking.redo(),
      Delete: () => marking.erase(),
      Backspace: () => marking.erase(),
    };
    const action = actions[key.length === 1 ? key.toLowerCase() : key];
    if (action) action();
    else if (number >= 1 && number <= 9) marking.choose(number - 1);
    else return false;
    return true;
  }

  /** @param {KeyboardEvent} event */
  #listenToUndo(event) {
    const { target, key, shiftKey } = event;
    if (!(event.ctrlKey || event.metaKey) || event.altKey) return;
    // A text that is typed has an undo of its own.
    if (target instanceof HTMLInputElement && target.type !== "range") return;
    const letter = key.toLowerCase();
    if (letter !== "z" && letter !== "y") return;
    event.preventDefault();
    if (letter === "y" || shiftKey) this.#marking.redo();
    else this.#marking.undo();
  }
}

/**
 * What is missing for a score, in words.
 * @param {Marking} marking
 */
function lackOf({ session, frames, done }) {
  const least = `TC is shown from ${LEAST_MARKED} marked frames on`;
  if (frames.length < LEAST_MARKED) {
    return `${least}, and these are only ${frames.length}: add more images.`;
  }
  if (done < LEAST_MARKED) return `${least}: ${integer(LEAST_MARKED - done)} to go.`;
  const { extraction, score, library } = session;
  if (score.evaluation) return "They are scored; more frames make the score surer.";
  if (extraction?.status === "running") {
    const extracted = `${integer(extraction.extracted.size)} of ${count(frames.length, "frame")}`;
    return `Enough for a score, once the keypoints are extracted: ${extracted}.`;
  }
  const hasDetector = session.encoder !== null || library.used("keypoints") !== null;
  return hasDetector ? "Enough for a score." : "Enough for a score: add a checkpoint or keypoints.";
}

/**
 * Which child has the focus.
 * @param {HTMLElement} place
 */
function focusedAt(place) {
  return [...place.children].findIndex((child) => child === document.activeElement);
}

/**
 * @param {string} id
 * @param {string} label
 * @param {() => void} onclick
 */
function button(id, label, onclick) {
  return h("button", { id, type: "button", class: "button", onclick }, label);
}
