// @ts-check
/**
 * What is wider than its place: it scrolls, by keyboard too, and fades at the side where there is
 * more.
 */

/** Less than this is rounding, in CSS pixels. */
const SLACK = 1;

/**
 * Watches an element that scrolls sideways. Only while there is something to scroll is it reached
 * by the keyboard.
 * @template {HTMLElement} E
 * @param {E} element with its one child, which may be wider
 * @param {string} label
 * @returns {E}
 */
export function scrollRegion(element, label) {
  element.classList.add("scroll-region");
  element.setAttribute("role", "group");
  element.setAttribute("aria-label", label);
  const update = () => {
    const { scrollLeft, scrollWidth, clientWidth, scrollHeight, clientHeight } = element;
    const before = scrollLeft > SLACK;
    const after = scrollWidth - clientWidth - scrollLeft > SLACK;
    element.dataset.more = before && after ? "both" : before ? "start" : after ? "end" : "none";
    if (before || after || scrollHeight - clientHeight > SLACK) element.tabIndex = 0;
    else element.removeAttribute("tabindex");
  };
  element.addEventListener("scroll", update, { passive: true });
  const watch = new ResizeObserver(update);
  watch.observe(element);
  if (element.firstElementChild) watch.observe(element.firstElementChild);
  return element;
}
