// @ts-check
/** Tells when an element has another size, with the next frame of the display. */

/**
 * What follows may change sizes again, which it must not while sizes are told.
 * @param {Element} element
 * @param {() => void} onResize
 */
export function onResized(element, onResize) {
  let isScheduled = false;
  new ResizeObserver(() => {
    if (isScheduled) return;
    isScheduled = true;
    requestAnimationFrame(() => {
      isScheduled = false;
      onResize();
    });
  }).observe(element);
}
