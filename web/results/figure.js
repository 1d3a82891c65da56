// @ts-check
/**
 * Figures of the results: SVG from the package, redrawn for the width and the colours in force,
 * saved as SVG and PNG.
 */

import init from "../pkg/index.js";
import { fill, h, icon } from "../ui/dom.js";
import { save } from "../ui/download.js";
import { toPng } from "../ui/png.js";
import { onResized } from "../ui/resized.js";
import { scrollRegion } from "../ui/scroll-region.js";

/**
 * @typedef {import("../pkg/index.js").Drawn} Drawn
 * @typedef {import("../pkg/index.js").Theme} Theme
 */

/** In CSS pixels. */
const FONT_SIZE = { usual: 13, narrow: 11 };
const NARROW = 480;
/** The width of a saved figure. */
const SAVED_WIDTH = 880;

/**
 * @typedef {object} FigureView
 * @property {HTMLElement} element
 * @property {HTMLElement} layer over the figure, for what reacts
 * @property {() => void} update
 * @property {(text: string | null, x?: number, y?: number) => void} showTip
 * @property {() => Drawn | null} drawing
 */

/**
 * A figure with its links to save it, a layer over it for what reacts, and a tip.
 * @param {object} options
 * @param {string} options.id
 * @param {string} options.label what it shows, for those who do not see it
 * @param {(theme: Theme | undefined, width: number) => Drawn | null} options.draw with the colours
 * of the page, or for a
 *   file; `null` when there is nothing to draw
 * @param {(drawn: Drawn, layer: HTMLElement) => void} [options.drawn] after each drawing
 * @returns {FigureView}
 */
export function figureView({ id, label, draw, drawn }) {
  const plate = h("div", { class: "figure-plate", role: "img", "aria-label": label });
  const layer = h("div", { class: "figure-layer" });
  const tip = h("div", { class: "figure-tip", hidden: true, "aria-hidden": "true" });
  const stack = h("div", { class: "figure-stack" }, plate, layer, tip);
  const scroll = scrollRegion(h("div", { class: "figure-scroll" }, stack), label);
  const links = saveLinks(id, label, () => draw(undefined, SAVED_WIDTH)?.svg ?? null);
  const element = h("figure", { class: "result-figure", id }, scroll, links);
  /** @type {Drawn | null} */
  let current = null;
  let width = 0;

  const update = async () => {
    try {
      await init(["figures"]);
    } catch (error) {
      fill(
        plate,
        h(
          "p",
          { class: "hint-line" },
          `The figure cannot be drawn: ${/** @type {Error} */ (error).message}`,
        ),
      );
      return;
    }
    // In a tab that is not shown there is nothing to draw on; what is drawn there is of before.
    width = scroll.clientWidth;
    if (width === 0) return;
    current = draw(schemeTheme(width), width);
    element.hidden = current === null;
    if (!current) return;
    fill(plate, toElement(current.svg));
    tip.hidden = true;
    drawn?.(current, layer);
  };
  onResized(scroll, () => {
    if (scroll.clientWidth !== width) void update();
  });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => void update());

  /**
   * @param {string | null} text `null` hides it
   * @param {number} [x] in the figure's pixels
   * @param {number} [y]
   */
  const showTip = (text, x = 0, y = 0) => {
    tip.hidden = text === null;
    if (text === null || !current) return;
    tip.textContent = text;
    tip.style.setProperty("--x", `${x}px`);
    tip.style.setProperty("--y", `${y}px`);
    tip.dataset.side = x > current.width / 2 ? "left" : "right";
  };
  return { element, layer, update: () => void update(), showTip, drawing: () => current };
}

/**
 * @param {string} id
 * @param {string} label
 * @param {() => string | null} svg for a file
 */
function saveLinks(id, label, svg) {
  const link = (/** @type {string} */ kind, /** @type {(svg: string) => void} */ write) =>
    h(
      "button",
      {
        type: "button",
        class: "link",
        id: `save-${id}-${kind.toLowerCase()}`,
        onclick: async () => {
          await init(["figures"]);
          const document = svg();
          if (document) write(document);
        },
      },
      icon("icon-download"),
      kind,
      h("span", { class: "visually-hidden" }, ` of: ${label}`),
    );
  return h(
    "div",
    { class: "figure-links" },
    link("SVG", (document) => save(`${id}.svg`, "image/svg+xml", document)),
    link("PNG", async (document) => save(`${id}.png`, "image/png", await toPng(document))),
  );
}

/** @param {string} svg */
function toElement(svg) {
  const element = new DOMParser().parseFromString(svg, "image/svg+xml").documentElement;
  element.setAttribute("aria-hidden", "true");
  return document.importNode(element, true);
}

/**
 * The colours of the style sheet under the scheme in force.
 * @param {number} width
 * @returns {Theme}
 */
function schemeTheme(width) {
  const style = getComputedStyle(document.documentElement);
  const color = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
  return {
    foreground: color("--text"),
    muted: color("--muted"),
    background: color("--surface"),
    grid: color("--plot-grid"),
    good: color("--good"),
    bad: color("--bad"),
    accent: color("--accent"),
    fontSize: width < NARROW ? FONT_SIZE.narrow : FONT_SIZE.usual,
  };
}
