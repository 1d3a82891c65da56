// @ts-check
/**
 * The sequences with their errors, to pick one; only the rows in sight are elements of the page.
 */

import { fill, h } from "../ui/dom.js";
import { count, significant } from "../ui/format.js";

/** @typedef {import("../session.js").Session} Session */

/** Height of a row, in the size of the page's text. */
const ROW_REM = 1.75;
/** Rows that are there beyond those in sight. */
const BEYOND = 6;
/** Bars are logarithmic between these errors, as the gauges of the cards. */
const SCALE = { from: 1e-4, to: 1 };

export class SequenceList {
  #session;
  #onPick;
  /** Sequences in the order of the list. @type {number[]} */
  #order = [];
  #worstFirst = false;
  #errors = new Float64Array();
  /** What the rows were made of. */
  #made = {};
  /** Position of the sequence on display. */
  #at = -1;
  /** Height of a row in CSS pixels: text may be zoomed. */
  #rowHeight = 28;
  #rows = h("div", { class: "sequence-rows", role: "presentation" });
  #list = h(
    "div",
    {
      id: "sequence-list",
      class: "sequence-list",
      role: "listbox",
      tabIndex: 0,
      "aria-labelledby": "sequence-list-title",
      onscroll: () => this.#draw(),
      onkeydown: (/** @type {KeyboardEvent} */ event) => this.#move(event),
    },
    this.#rows,
  );
  #sorting = h(
    "button",
    {
      type: "button",
      id: "worst-first",
      class: "link",
      "aria-pressed": "false",
      onclick: () => this.#sort(),
    },
    "Worst first",
  );
  #title = h("h3", { id: "sequence-list-title", class: "small-title" }, "Sequences");
  element = h(
    "div",
    { class: "viewer-sequences" },
    h("div", { class: "sequence-head" }, this.#title, this.#sorting),
    this.#list,
  );

  /**
   * @param {Session} session
   * @param {(sequence: import("../pkg/index.js").SequenceRange) => void} onPick
   */
  constructor(session, onPick) {
    this.#session = session;
    this.#onPick = onPick;
    new ResizeObserver(() => this.#draw()).observe(this.#list);
  }

  /** Follows the session; does nothing while only the frame within a sequence changes. */
  update() {
    const { evaluation, selection, sequences, shown } = this.#session.score;
    if (!shown) return;
    // Another evaluation is another object.
    const before = this.#made;
    this.#made = {
      shown,
      evaluation,
      object: selection.object,
      keypoint: this.#session.score.keypointOf(selection.object),
      worstFirst: this.#worstFirst,
    };
    const same = Object.entries(this.#made).every(
      ([key, value]) => Reflect.get(before, key) === value,
    );
    if (same && this.#current() === this.#at) return;
    if (!same) {
      this.#errors = this.#session.score.sequenceErrors(selection.object);
      this.#order = [...sequences.keys()];
      const rank = (/** @type {number} */ i) =>
        Number.isNaN(this.#errors[i]) ? -1 : this.#errors[i];
      if (this.#worstFirst) this.#order.sort((a, b) => rank(b) - rank(a));
    }
    this.#at = this.#current();
    const count = this.#order.length;
    this.#rowHeight = ROW_REM * parseFloat(getComputedStyle(document.documentElement).fontSize);
    this.#rows.style.height = `${count * this.#rowHeight}px`;
    this.#title.textContent = count === 1 ? "Sequence" : `${count.toLocaleString("en")} sequences`;
    this.#sorting.hidden = count < 2;
    this.#follow();
    this.#draw();
  }

  /** The sequence on display; -1 where there is none. */
  #shown() {
    const { score } = this.#session;
    const range = score.sequenceOf(score.selection.frame);
    return range ? score.sequences.indexOf(range) : -1;
  }

  #current() {
    return this.#order.indexOf(this.#shown());
  }

  /** @param {number} sequence */
  #pick(sequence) {
    const range = this.#session.score.sequences[sequence];
    if (range) this.#onPick(range);
  }

  #sort() {
    this.#worstFirst = !this.#worstFirst;
    this.#sorting.setAttribute("aria-pressed", String(this.#worstFirst));
    this.update();
  }

  /** @param {KeyboardEvent} event */
  #move(event) {
    const last = this.#order.length - 1;
    const to = {
      ArrowDown: this.#current() + 1,
      ArrowUp: this.#current() - 1,
      Home: 0,
      End: last,
    }[event.key];
    if (to === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    event.stopPropagation();
    this.#pick(this.#order[Math.min(Math.max(to, 0), last)]);
  }

  /** The row of the sequence on display comes into sight. */
  #follow() {
    if (this.#at < 0) return;
    const { scrollTop, clientHeight } = this.#list;
    const [top, bottom] = [this.#at * this.#rowHeight, (this.#at + 1) * this.#rowHeight];
    if (top < scrollTop) this.#list.scrollTop = top;
    else if (bottom > scrollTop + clientHeight) this.#list.scrollTop = bottom - clientHeight;
  }

  #draw() {
    // The list also hears of its size when everything was removed.
    if (!this.#session.score.shown) return;
    const { scrollTop, clientHeight } = this.#list;
    const first = Math.max(0, Math.floor(scrollTop / this.#rowHeight) - BEYOND);
    const last = Math.min(
      this.#order.length,
      Math.ceil((scrollTop + clientHeight) / this.#rowHeight) + BEYOND,
    );
    const selected = this.#shown();
    const inSight = this.#order.slice(first, last);
    const positions = inSight.map((_, i) => first + i);
    // What assistive technology is told to be active has to exist.
    if (this.#at >= 0 && !inSight.includes(selected)) positions.push(this.#at);
    fill(
      this.#rows,
      ...positions.map((position) => this.#row(position, this.#order[position] === selected)),
    );
    const active = this.#at >= 0 ? `sequence-${selected}` : "";
    this.#list.setAttribute("aria-activedescendant", active);
  }

  /**
   * @param {number} position
   * @param {boolean} selected
   */
  #row(position, selected) {
    const { score } = this.#session;
    const sequence = this.#order[position];
    const { name, length } = score.sequences[sequence];
    const error = this.#errors[sequence];
    const threshold = score.judged?.objects[score.selection.object]?.threshold ?? NaN;
    const seen = !Number.isNaN(error);
    const unseen = score.scoring ? "object not visible" : "not scored yet";
    const frames = count(length, "frame");
    const element = h(
      "div",
      {
        id: `sequence-${sequence}`,
        class: "sequence",
        role: "option",
        "aria-selected": String(selected),
        "aria-posinset": String(position + 1),
        "aria-setsize": String(this.#order.length),
        title: `${name}: ${frames}`,
        data: { tracked: seen ? String(error <= threshold) : "none", error: String(error), name },
        onclick: () => this.#pick(sequence),
      },
      h("span", { class: "sequence-name" }, name),
      h("span", { class: "visually-hidden" }, `, ${frames}, ${seen ? "error" : unseen} `),
      errorBar(error, threshold),
      h("span", { class: "sequence-error" }, significant(error)),
    );
    element.style.top = `${position * this.#rowHeight}px`;
    return element;
  }
}

/**
 * @param {number} error NaN where there is none
 * @param {number} threshold
 */
function errorBar(error, threshold) {
  const [extent, tick] = [h("span"), h("span")];
  extent.style.width = Number.isNaN(error) ? "0" : `${Math.max(2, share(error))}%`;
  tick.style.left = `${share(threshold)}%`;
  return h("span", { class: "sequence-bar", "aria-hidden": "true" }, extent, tick);
}

/**
 * Where an error lies on a bar, in per cent.
 * @param {number} error
 */
function share(error) {
  return (
    100 * Math.min(1, Math.max(0, Math.log(error / SCALE.from) / Math.log(SCALE.to / SCALE.from)))
  );
}
