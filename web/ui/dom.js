// @ts-check
/** Building elements without a framework. */

/**
 * @typedef {Node | string | null | undefined | false} Child
 * @typedef {Record<string, unknown>} Properties
 *   `class`, `data` (an object), `on<event>` (a listener), `aria-…` and other attributes, or
 *   properties by name.
 */

/**
 * Makes an element.
 * @template {keyof HTMLElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {Properties} [properties]
 * @param {...Child} children
 * @returns {HTMLElementTagNameMap[Tag]}
 */
export function h(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (name === "class") element.className = String(value);
    else if (name === "data") Object.assign(element.dataset, value);
    else if (name.startsWith("on")) {
      element.addEventListener(name.slice(2), /** @type {EventListener} */ (value));
    } else if (name in element && !name.includes("-")) Object.assign(element, { [name]: value });
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  element.append(...present(children));
  return element;
}

/**
 * Replaces the content of an element.
 * @param {Element} element
 * @param {...Child} children
 */
export function fill(element, ...children) {
  element.replaceChildren(...present(children));
}

/**
 * An icon of the sprite in the page.
 * @param {string} id
 */
export function icon(id, className = "icon") {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("class", className);
  svg.setAttribute("aria-hidden", "true");
  const use = document.createElementNS("http://www.w3.org/2000/svg", "use");
  use.setAttribute("href", `#${id}`);
  svg.append(use);
  return svg;
}

/**
 * Text with `code` between backticks.
 * @param {string} text
 * @returns {Child[]}
 */
export function prose(text) {
  return text.split("`").map((part, i) => (i % 2 === 1 ? h("code", {}, part) : part));
}

/**
 * The one element with an id.
 * @template {HTMLElement} [E=HTMLElement]
 * @param {string} id
 * @returns {E}
 */
export function byId(id) {
  const element = document.getElementById(id);
  if (!element) throw new Error(`the page has no element #${id}`);
  return /** @type {E} */ (element);
}

/**
 * A message with its remedy.
 * @param {"error" | "warning" | "info"} kind
 * @param {string} text
 * @param {{ action?: { label: string, run: () => void }, dismiss?: () => void, class?: string,
 * isQuiet?: boolean }} [options]
 *   `isQuiet`: an error that is said elsewhere, too
 */
export function notice(kind, text, { action, dismiss, class: extra, isQuiet = false } = {}) {
  return h(
    "div",
    {
      class: extra ? `notice ${extra}` : "notice",
      data: { kind },
      role: kind === "error" && !isQuiet ? "alert" : null,
    },
    icon(kind === "info" ? "icon-info" : "icon-warning"),
    h(
      "div",
      { class: "notice-body" },
      h("p", {}, ...prose(text)),
      action && h("button", { type: "button", class: "link", onclick: action.run }, action.label),
    ),
    dismiss &&
      h(
        "button",
        {
          type: "button",
          class: "icon-button",
          "aria-label": "Dismiss",
          title: "Dismiss",
          onclick: dismiss,
        },
        icon("icon-cross"),
      ),
  );
}

/** What is to be announced together. @type {string[]} */
let announcements = [];

/**
 * Says something to screen readers without moving the focus. All that is announced in one go is
 * said in one.
 * @param {string} text
 */
export function announce(text) {
  if (announcements.length === 0) {
    queueMicrotask(() => {
      byId("status").textContent = announcements.join(" ");
      announcements = [];
    });
  }
  announcements.push(text);
}

/** @param {Child[]} children */
function present(children) {
  return children.filter((child) => child !== null && child !== undefined && child !== false);
}
