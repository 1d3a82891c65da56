// @ts-check
/**
 * Tabs as in the page: buttons of a `tablist`, each with the panel that its `aria-controls` names.
 * A tab whose panel has nothing to show is not there. What is chosen stays as long as it is there;
 * until somebody chooses, the first one is shown.
 */

/** Tabs that somebody chose, by their list. @type {WeakMap<Element, HTMLElement>} */
const chosen = new WeakMap();

/** @type {Record<string, number>} */
const STEPS = { ArrowLeft: -1, ArrowRight: 1, Home: -Infinity, End: Infinity };

/** @param {HTMLElement} list */
export function listenToTabs(list) {
  list.addEventListener("click", ({ target }) => {
    const tab = target instanceof Element && target.closest("[role=tab]");
    if (tab instanceof HTMLElement) choose(list, tab);
  });
  list.addEventListener("keydown", (event) => {
    const step = STEPS[event.key];
    if (step === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
    const tabs = tabsOf(list).filter(({ hidden }) => !hidden);
    const at = tabs.findIndex((tab) => tab === document.activeElement);
    if (at < 0) return;
    event.preventDefault();
    const around = (at + step + tabs.length) % tabs.length;
    const next = Number.isFinite(step) ? tabs[around] : tabs[step < 0 ? 0 : tabs.length - 1];
    choose(list, next);
    next.focus();
  });
  settle(list);
}

/**
 * Says whether a panel has something to show.
 * @param {HTMLElement} panel
 * @param {boolean} isAvailable
 */
export function setAvailable(panel, isAvailable) {
  const tab = tabOf(panel);
  const list = tab?.closest("[role=tablist]");
  if (!tab || !(list instanceof HTMLElement) || tab.hidden === !isAvailable) return;
  tab.hidden = !isAvailable;
  settle(list);
}

/**
 * Opens the tab and the disclosures that an element is in.
 * @param {Element} element
 */
export function reveal(element) {
  for (let at = element.parentElement; at; at = at.parentElement) {
    if (at instanceof HTMLDetailsElement) at.open = true;
    if (at.getAttribute("role") === "tabpanel") {
      const tab = tabOf(at);
      const list = tab?.closest("[role=tablist]");
      if (tab && list instanceof HTMLElement) choose(list, tab);
    }
  }
}

/**
 * @param {HTMLElement} list
 * @param {HTMLElement} tab
 */
function choose(list, tab) {
  if (tab.hidden) return;
  chosen.set(list, tab);
  settle(list);
}

/**
 * Shows the panel of the tab that is chosen.
 * @param {HTMLElement} list
 */
function settle(list) {
  const tabs = tabsOf(list);
  const wanted = chosen.get(list);
  const current = wanted && !wanted.hidden ? wanted : tabs.find(({ hidden }) => !hidden);
  list.hidden = current === undefined;
  for (const tab of tabs) {
    const isSelected = tab === current;
    tab.setAttribute("aria-selected", String(isSelected));
    tab.tabIndex = isSelected ? 0 : -1;
    const panel = document.getElementById(tab.getAttribute("aria-controls") ?? "");
    if (panel) panel.hidden = !isSelected;
  }
}

/** @param {Element} list */
function tabsOf(list) {
  return /** @type {HTMLElement[]} */ ([...list.querySelectorAll("[role=tab]")]);
}

/**
 * @param {Element} panel
 * @returns {HTMLElement | null}
 */
function tabOf(panel) {
  return document.querySelector(`[role=tab][aria-controls="${panel.id}"]`);
}
