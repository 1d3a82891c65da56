// @ts-check
/** Zooming and panning of a canvas: wheel, pinch, drag and keys. */

import { WHOLE, panned, zoomed } from "./view.js";

/** @typedef {import("./view.js").View} View */

const KEY_ZOOM = 1.5;
/** Share of the canvas. */
const KEY_PAN = 0.1;
/** A press that moves less, in CSS pixels, is a click. */
const CLICK = 4;
const MIDDLE = { x: 0.5, y: 0.5 };

/** @type {Record<string, { x: number, y: number }>} */
const PAN_KEYS = {
  a: { x: KEY_PAN, y: 0 },
  d: { x: -KEY_PAN, y: 0 },
  w: { x: 0, y: KEY_PAN },
  s: { x: 0, y: -KEY_PAN },
};

/**
 * @param {HTMLCanvasElement} canvas
 * @param {object} listener
 * @param {(view: View) => void} listener.onView
 * @param {(event: PointerEvent) => void} listener.onClick a press and release in the same place
 */
export function gestures(canvas, { onView, onClick }) {
  /** @type {View} */
  let view = WHOLE;
  const show = (/** @type {View} */ next) => {
    view = next;
    // A finger moves the page while all of the image is on display, and the image once it is not.
    canvas.style.touchAction = view.zoom > 1 ? "none" : "pan-x pan-y";
    canvas.dataset.zoom = String(view.zoom);
    onView(view);
  };

  const share = (/** @type {{ clientX: number, clientY: number }} */ { clientX, clientY }) => {
    const { left, top, width, height } = canvas.getBoundingClientRect();
    return { x: (clientX - left) / width, y: (clientY - top) / height };
  };

  // The page keeps its wheel until the canvas was clicked or the gesture is one of zooming.
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (!event.ctrlKey && document.activeElement !== canvas) return;
      if (event.deltaY > 0 && view.zoom === 1 && !event.ctrlKey) return;
      event.preventDefault();
      const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 20 : 1;
      show(
        zoomed(
          view,
          Math.exp(-0.002 * lines * event.deltaY * (event.ctrlKey ? 4 : 1)),
          share(event),
        ),
      );
    },
    { passive: false },
  );

  /** @type {Map<number, PointerEvent>} */
  const pressed = new Map();
  let travelled = 0;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.focus({ preventScroll: true });
    if (pressed.size === 0) travelled = 0;
    pressed.set(event.pointerId, event);
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = pressed.get(event.pointerId);
    if (!before) return;
    const [from, to] = [share(before), share(event)];
    travelled += Math.hypot(event.clientX - before.clientX, event.clientY - before.clientY);
    if (pressed.size === 2) {
      const [other] = [...pressed.values()].filter(
        ({ pointerId }) => pointerId !== event.pointerId,
      );
      const still = share(other);
      const span = (/** @type {{ x: number, y: number }} */ { x, y }) =>
        Math.hypot(x - still.x, y - still.y);
      show(zoomed(view, span(to) / Math.max(span(from), 1e-3), still));
    } else if (view.zoom > 1 && travelled > CLICK) {
      show(panned(view, { x: to.x - from.x, y: to.y - from.y }));
    }
    pressed.set(event.pointerId, event);
  });
  const release = (/** @type {PointerEvent} */ event) => {
    if (
      pressed.delete(event.pointerId) &&
      pressed.size === 0 &&
      travelled <= CLICK &&
      event.type === "pointerup"
    ) {
      onClick(event);
    }
  };
  for (const type of /** @type {const} */ (["pointerup", "pointercancel"]))
    canvas.addEventListener(type, release);

  const zoomIn = () => show(zoomed(view, KEY_ZOOM, MIDDLE));
  const zoomOut = () => show(zoomed(view, 1 / KEY_ZOOM, MIDDLE));
  const reset = () => show(WHOLE);
  /**
   * Whether the key zooms or pans.
   * @param {string} key
   */
  const key = (key) => {
    if (key === "+" || key === "=") zoomIn();
    else if (key === "-" || key === "_") zoomOut();
    else if (key === "0") reset();
    else if (PAN_KEYS[key]) show(panned(view, PAN_KEYS[key]));
    else return false;
    return true;
  };
  show(WHOLE);
  return { zoomIn, zoomOut, reset, key };
}
