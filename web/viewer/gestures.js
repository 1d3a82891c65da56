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

export class Gestures {
  #canvas;
  #onView;
  #onClick;
  /** @type {View} */
  #view = WHOLE;
  /** @type {Map<number, PointerEvent>} */
  #pressed = new Map();
  /** How far the pointer went since it was pressed, in CSS pixels. */
  #travelled = 0;

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {object} listener
   * @param {(view: View) => void} listener.onView
   * @param {(event: PointerEvent) => void} listener.onClick a press and release in the same place
   */
  constructor(canvas, { onView, onClick }) {
    this.#canvas = canvas;
    this.#onView = onView;
    this.#onClick = onClick;
    canvas.addEventListener("wheel", (event) => this.#turn(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.#press(event));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    for (const type of /** @type {const} */ (["pointerup", "pointercancel"]))
      canvas.addEventListener(type, (event) => this.#release(event));
    this.reset();
  }

  zoomIn() {
    this.#show(zoomed(this.#view, KEY_ZOOM, MIDDLE));
  }

  zoomOut() {
    this.#show(zoomed(this.#view, 1 / KEY_ZOOM, MIDDLE));
  }

  reset() {
    this.#show(WHOLE);
  }

  /**
   * Whether the key zooms or pans.
   * @param {string} key
   */
  key(key) {
    if (key === "+" || key === "=") this.zoomIn();
    else if (key === "-" || key === "_") this.zoomOut();
    else if (key === "0") this.reset();
    else if (PAN_KEYS[key]) this.#show(panned(this.#view, PAN_KEYS[key]));
    else return false;
    return true;
  }

  /** @param {View} view */
  #show(view) {
    this.#view = view;
    // A finger moves the page while all of the image is on display, and the image once it is not.
    this.#canvas.style.touchAction = view.zoom > 1 ? "none" : "pan-x pan-y";
    this.#canvas.dataset.zoom = String(view.zoom);
    this.#onView(view);
  }

  /**
   * Where an event is, in the width and height of the canvas.
   * @param {{ clientX: number, clientY: number }} event
   */
  share({ clientX, clientY }) {
    const { left, top, width, height } = this.#canvas.getBoundingClientRect();
    return { x: (clientX - left) / width, y: (clientY - top) / height };
  }

  /**
   * The page keeps its wheel until the canvas was clicked or the gesture is one of zooming.
   * @param {WheelEvent} event
   */
  #turn(event) {
    if (!event.ctrlKey && document.activeElement !== this.#canvas) return;
    if (event.deltaY > 0 && this.#view.zoom === 1 && !event.ctrlKey) return;
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 20 : 1;
    const factor = Math.exp(-0.002 * lines * event.deltaY * (event.ctrlKey ? 4 : 1));
    this.#show(zoomed(this.#view, factor, this.share(event)));
  }

  /** @param {PointerEvent} event */
  #press(event) {
    this.#canvas.focus({ preventScroll: true });
    if (this.#pressed.size === 0) this.#travelled = 0;
    this.#pressed.set(event.pointerId, event);
    this.#canvas.setPointerCapture(event.pointerId);
  }

  /** @param {PointerEvent} event */
  #move(event) {
    const before = this.#pressed.get(event.pointerId);
    if (!before) return;
    const [from, to] = [this.share(before), this.share(event)];
    this.#travelled += Math.hypot(event.clientX - before.clientX, event.clientY - before.clientY);
    const others = [...this.#pressed.values()].filter((e) => e.pointerId !== event.pointerId);
    if (others.length === 1) {
      const still = this.share(others[0]);
      const span = (/** @type {{ x: number, y: number }} */ { x, y }) =>
        Math.hypot(x - still.x, y - still.y);
      this.#show(zoomed(this.#view, span(to) / Math.max(span(from), 1e-3), still));
    } else if (this.#view.zoom > 1 && this.#travelled > CLICK) {
      this.#show(panned(this.#view, { x: to.x - from.x, y: to.y - from.y }));
    }
    this.#pressed.set(event.pointerId, event);
  }

  /** @param {PointerEvent} event */
  #release(event) {
    const isLast = this.#pressed.delete(event.pointerId) && this.#pressed.size === 0;
    if (isLast && this.#travelled <= CLICK && event.type === "pointerup") this.#onClick(event);
  }
}
