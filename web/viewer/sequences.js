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

/**
 * @param {Session} session
 * @param {(sequence: import("../pkg/index.js").SequenceRange) => void} onPick
 */
export function sequenceList(session, onPick) {
  /** Sequences in the order of the list. @type {number[]} */
  let order = [];
  let worstFirst = false;
  let errors = new Float64Array();

  const rows = h("div", { class: "sequence-rows", role: "presentation" });
  const list = h(
    "div",
    {
      id: "sequence-list",
      class: "sequence-list",
      role: "listbox",
      tabIndex: 0,
      "aria-labelledby": "sequence-list-title",
      onscroll: () => draw(),
      onkeydown: (/** @type {KeyboardEvent} */ event) => {
        const to = {
          ArrowDown: current() + 1,
          ArrowUp: current() - 1,
          Home: 0,
          End: order.length - 1,
        }[event.key];
        if (to === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
        event.preventDefault();
        event.stopPropagation();
        pick(order[Math.min(Math.max(to, 0), order.length - 1)]);
      },
    },
    rows,
  );
  const sorting = h(
    "button",
    {
      type: "button",
      id: "worst-first",
      class: "link",
      "aria-pressed": "false",
      onclick: () => {
        worstFirst = !worstFirst;
        sorting.setAttribute("aria-pressed", String(worstFirst));
        update();
      },
    },
    "Worst first",
  );
  const title = h("h3", { id: "sequence-list-title", class: "small-title" }, "Sequences");
  const element = h(
    "div",
    { class: "viewer-sequences" },
    h("div", { class: "sequence-head" }, title, sorting),
    list,
  );

  const shown = () => {
    const range = session.score.sequenceOf(session.score.selection.frame);
    return range ? session.score.sequences.indexOf(range) : -1;
  };
  const current = () => order.indexOf(shown());
  const pick = (/** @type {number} */ sequence) => {
    const range = session.score.sequences[sequence];
    if (range) onPick(range);
  };

  /** Height of a row in CSS pixels: text may be zoomed. */
  let rowHeight = 28;
  const draw = () => {
    // The list also hears of its size when everything was removed.
    if (!session.score.shown) return;
    const first = Math.max(0, Math.floor(list.scrollTop / rowHeight) - BEYOND);
    const last = Math.min(
      order.length,
      Math.ceil((list.scrollTop + list.clientHeight) / rowHeight) + BEYOND,
    );
    const selected = shown();
    const inSight = order.slice(first, last);
    const positions = inSight.map((_, i) => first + i);
    // What assistive technology is told to be active has to exist.
    if (at >= 0 && !inSight.includes(selected)) positions.push(at);
    fill(rows, ...positions.map((position) => row(position, order[position] === selected)));
    list.setAttribute("aria-activedescendant", at >= 0 ? `sequence-${selected}` : "");
  };

  /**
   * @param {number} position
   * @param {boolean} selected
   */
  const row = (position, selected) => {
    const sequence = order[position];
    const { name, length } = session.score.sequences[sequence];
    const error = errors[sequence];
    const { threshold } = session.score.judged?.objects[session.score.selection.object] ?? {
      threshold: NaN,
    };
    const seen = !Number.isNaN(error);
    const unseen = session.score.scoring ? "object not visible" : "not scored yet";
    const bar = h("span", { class: "sequence-bar", "aria-hidden": "true" }, h("span"), h("span"));
    const [extent, tick] = /** @type {HTMLElement[]} */ ([...bar.children]);
    extent.style.width = seen ? `${Math.max(2, share(error))}%` : "0";
    tick.style.left = `${share(threshold)}%`;
    const element = h(
      "div",
      {
        id: `sequence-${sequence}`,
        class: "sequence",
        role: "option",
        "aria-selected": String(selected),
        "aria-posinset": String(position + 1),
        "aria-setsize": String(order.length),
        title: `${name}: ${count(length, "frame")}`,
        data: { tracked: seen ? String(error <= threshold) : "none", error: String(error), name },
        onclick: () => pick(sequence),
      },
      h("span", { class: "sequence-name" }, name),
      h(
        "span",
        { class: "visually-hidden" },
        `, ${count(length, "frame")}, ${seen ? "error" : unseen} `,
      ),
      bar,
      h("span", { class: "sequence-error" }, significant(error)),
    );
    element.style.top = `${position * rowHeight}px`;
    return element;
  };

  /** The row of the sequence on display comes into sight. */
  const follow = () => {
    if (at < 0) return;
    const { scrollTop, clientHeight } = list;
    if (at * rowHeight < scrollTop) list.scrollTop = at * rowHeight;
    else if ((at + 1) * rowHeight > scrollTop + clientHeight)
      list.scrollTop = (at + 1) * rowHeight - clientHeight;
  };

  /** What the rows were made of. */
  let scored = {};
  /** Position of the sequence on display. */
  let at = -1;
  /** Follows the session; does nothing while only the frame within a sequence changes. */
  const update = () => {
    const { evaluation, selection, sequences, shown } = session.score;
    if (!shown) return;
    // Another evaluation is another object.
    const shownBefore = scored;
    scored = {
      shown,
      evaluation,
      object: selection.object,
      keypoint: session.score.keypointOf(selection.object),
      worstFirst,
    };
    const same = Object.entries(scored).every(
      ([key, value]) => Reflect.get(shownBefore, key) === value,
    );
    if (same && current() === at) return;
    at = current();
    if (!same) {
      errors = session.score.sequenceErrors(selection.object);
      order = [...sequences.keys()];
      const rank = (/** @type {number} */ i) => (Number.isNaN(errors[i]) ? -1 : errors[i]);
      if (worstFirst) order.sort((a, b) => rank(b) - rank(a));
      at = current();
    }
    rowHeight = ROW_REM * parseFloat(getComputedStyle(document.documentElement).fontSize);
    rows.style.height = `${order.length * rowHeight}px`;
    title.textContent =
      order.length === 1 ? "Sequence" : `${order.length.toLocaleString("en")} sequences`;
    sorting.hidden = order.length < 2;
    follow();
    draw();
  };
  new ResizeObserver(draw).observe(list);
  return { element, update };
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
