// @ts-check
/**
 * Marking a ground truth by hand: what is on display, what a click means, and when the session gets
 * the marks. Fetched when somebody asks for it.
 */

import { LEAST_MARKED } from "../files/texts.js";
import { opener } from "../ui/instead.js";
import { framesOf, proposed } from "./frames.js";
import { keepMarks, keptMarks } from "./keep.js";
import { Marks, csvOf } from "./marks.js";
import { MarkingView } from "./view.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./frames.js").MarkedFrame} MarkedFrame
 */

/** Milliseconds without a change before the session gets the marks. */
const QUIET = 500;
/** Milliseconds that the last mark of a frame is looked at. */
const LOOK = 350;

/** Opens the marking, or goes back to it. */
export const openMarking = opener(
  new URL("./marking.css", import.meta.url),
  (/** @type {Session} */ session) => new Marking(session),
);

export class Marking {
  /** @type {MarkedFrame[]} */
  frames = [];
  /** Position of the frame on display. */
  at = 0;
  /** The object that the next click marks. */
  object = 0;
  marks = new Marks(null);
  /** Whether the marks outlast the page. */
  isKept = true;

  session;
  #view;
  #isOpen = false;
  /** Of the images that `marks` are of. */
  #paths = "";
  /** The frames by sequence. @type {{ start: number, length: number }[]} */
  #sequences = [];
  /** Whether the session has other marks. */
  #isDue = false;
  #handing = 0;
  #moving = 0;

  /** @param {Session} session */
  constructor(session) {
    this.session = session;
    this.#view = new MarkingView(this);
    session.addEventListener("files", () => this.#follow());
    session.addEventListener("extraction", () => this.#isDue && this.#handOverSoon());
    window.addEventListener("beforeunload", (event) => {
      if (this.#isOpen && !this.isKept) event.preventDefault();
    });
  }

  open() {
    this.#isOpen = true;
    this.#follow();
    this.#view.open();
  }

  close() {
    this.#isOpen = false;
    this.#view.close();
    void this.#handOver();
  }

  /** The frame on display. */
  get frame() {
    return this.frames[this.at];
  }

  /** Frames that are marked. */
  get done() {
    return this.frames.filter(({ key }) => this.marks.isComplete(key)).length;
  }

  /** The marks as a table. */
  get csv() {
    return csvOf(this.marks, this.frames);
  }

  // What the user does

  /** @param {{ x: number, y: number }} point in ndc */
  place(point) {
    this.#mark({ x: point.x, y: point.y });
  }

  hide() {
    this.#mark("hidden");
  }

  /** Takes back the mark of the object at hand in this frame. */
  erase() {
    if (this.marks.of(this.frame.key)[this.object] === null) return;
    this.marks.set(this.frame.key, this.object, null);
  }

  /** @param {number} by frames */
  step(by) {
    this.#show(Math.min(Math.max(this.at + by, 0), this.frames.length - 1));
  }

  /** @param {number} at position of a frame */
  goTo(at) {
    this.#show(at);
  }

  /** Goes to the next frame that is proposed and not marked yet. */
  goOn() {
    const open = this.#proposals.filter((at) => !this.marks.isComplete(this.frames[at].key));
    const next = open.find((at) => at > this.at) ?? open[0];
    if (next !== undefined) this.#show(next);
  }

  /** @param {number} object */
  choose(object) {
    if (object < 0 || object >= this.marks.objects.length) return;
    this.object = object;
    this.#view.update();
  }

  addObject() {
    this.object = this.marks.objects.length;
    this.marks.addObject(this.frame.key);
  }

  /**
   * @param {number} object
   * @param {string} name
   * @returns {string} why it cannot be called that; empty if it can
   */
  rename(object, name) {
    if (name === this.marks.objects[object]) return "";
    if (name === "") return "An object needs a name.";
    if (this.marks.objects.includes(name)) return `There is an object ${name} already.`;
    this.marks.rename(object, name, this.frame.key);
    return "";
  }

  /** @param {number} object */
  removeObject(object) {
    if (object <= this.object && this.object > 0) this.object--;
    this.marks.removeObject(object, this.frame.key);
  }

  undo() {
    this.#showKey(this.marks.undo());
  }

  redo() {
    this.#showKey(this.marks.redo());
  }

  // What follows

  /** As many as a score takes, then as many again. */
  get #proposals() {
    const rounds = Math.floor(this.done / LEAST_MARKED) + 1;
    let wanted = rounds * LEAST_MARKED;
    for (;;) {
      const found = proposed(this.#sequences, wanted);
      const isOpen = found.some((at) => !this.marks.isComplete(this.frames[at].key));
      if (isOpen || found.length === this.frames.length) return found;
      wanted += LEAST_MARKED;
    }
  }

  /** @param {import("./marks.js").Mark} mark */
  #mark(mark) {
    // While an image is read, the one before it is still seen, and would be what was clicked.
    if (!this.#view.isCurrent) return;
    const { key } = this.frame;
    const wasComplete = this.marks.isComplete(key);
    const isNew = this.marks.of(key)[this.object] === null;
    clearTimeout(this.#moving);
    this.marks.set(key, this.object, mark);
    if (!wasComplete && this.marks.isComplete(key)) {
      this.#moving = setTimeout(() => this.goOn(), LOOK);
    } else if (isNew) this.#goToOpenObject();
  }

  /** The next object of this frame that has no mark. */
  #goToOpenObject() {
    const marks = this.marks.of(this.frame.key);
    const next = marks.findIndex((mark, i) => mark === null && i > this.object);
    this.choose(next >= 0 ? next : marks.indexOf(null));
  }

  /** @param {number} at */
  #show(at) {
    clearTimeout(this.#moving);
    this.at = at;
    const first = this.marks.of(this.frame.key).indexOf(null);
    this.object = first >= 0 ? first : Math.min(this.object, this.marks.objects.length - 1);
    this.#view.update();
  }

  /** @param {string | null} key */
  #showKey(key) {
    if (key === null) return;
    this.object = Math.min(this.object, this.marks.objects.length - 1);
    const at = this.frames.findIndex((frame) => frame.key === key);
    if (at >= 0) this.#show(at);
  }

  /** Takes the images of the session; other ones may have marks of their own. */
  #follow() {
    if (!this.#isOpen) return;
    const { session } = this;
    const paths = session.frameSources.map(({ path }) => path).join("\n");
    if (paths !== this.#paths || paths === "") {
      this.#paths = paths;
      this.#sequences = session.frames?.sequences ?? [];
      const before = new Map(this.frames.map(({ key, source }) => [key, source.path]));
      this.frames = framesOf(session);
      if (this.frames.length === 0) {
        this.#isOpen = false;
        this.#view.close();
        return;
      }
      const areMore = this.frames.some(
        ({ key, source }) => before.get(key) === source.path && this.marks.has(key),
      );
      if (areMore) this.#goOnWithMore();
      else this.#take(new Marks(keptMarks(session)));
    }
    this.#view.update();
  }

  /** Keeps the marks where other images came beside those that they are of. */
  #goOnWithMore() {
    this.at = Math.min(this.at, this.frames.length - 1);
    this.#changed();
  }

  /** @param {Marks} marks */
  #take(marks) {
    this.marks = marks;
    this.object = 0;
    this.at = 0;
    marks.addEventListener("change", () => this.#changed());
    this.#view.renew();
    if (marks.state.frames.size > 0) this.#changed();
    const first = this.#proposals.find((at) => !marks.isComplete(this.frames[at].key));
    this.#show(first ?? 0);
  }

  #changed() {
    this.isKept = keepMarks(this.session, this.marks.state);
    this.#isDue = true;
    this.#handOverSoon();
    this.#view.update();
  }

  #handOverSoon() {
    clearTimeout(this.#handing);
    this.#handing = setTimeout(() => {
      // A change would stop what is being extracted.
      if (this.session.extraction?.status !== "running") void this.#handOver();
    }, QUIET);
  }

  /** Gives the session what is marked, which scores it once it is enough. */
  async #handOver() {
    clearTimeout(this.#handing);
    const { done } = this;
    if (!this.#isDue || (done === 0 && this.session.marked === null)) return;
    this.#isDue = false;
    const isEmpty = this.marks.state.frames.size === 0;
    const table = isEmpty ? null : new Blob([this.csv], { type: "text/csv" });
    await this.session.setMarks(table, done);
  }
}
