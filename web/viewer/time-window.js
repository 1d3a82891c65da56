// @ts-check
/** The part of the time axis that the plots show. */

/** What a press of a button or a turn of the wheel zooms by. */
export const ZOOM = 1.5;
/** Fewer positions than these are not shown. */
const LEAST = 5;

export class TimeWindow {
  /** First and last position shown, both included. */
  from = 0;
  to = 0;
  /** Positions of the sequence on display. */
  length = 1;

  /** @param {number} length of another sequence */
  reset(length) {
    Object.assign(this, { from: 0, to: length - 1, length });
  }

  /** Whether not all is shown. */
  get isZoomed() {
    return this.to - this.from < this.length - 1;
  }

  /**
   * @param {number} factor above 1: fewer positions
   * @param {number} at the position that stays where it is
   */
  zoom(factor, at) {
    const span = this.to - this.from;
    const next = Math.round(Math.min(this.length - 1, Math.max(LEAST - 1, span / factor)));
    const share = span > 0 ? (at - this.from) / span : 0.5;
    this.#show(Math.round(at - share * next), next);
  }

  /** @param {number} by positions */
  pan(by) {
    this.#show(this.from + Math.round(by), this.to - this.from);
  }

  /**
   * Moves so far that a position is shown.
   * @param {number} position
   * @returns {boolean} whether it had to move
   */
  follow(position) {
    if (position >= this.from && position <= this.to) return false;
    this.#show(position, this.to - this.from);
    return true;
  }

  /**
   * @param {number} from
   * @param {number} span
   */
  #show(from, span) {
    this.from = Math.min(Math.max(from, 0), Math.max(0, this.length - 1 - span));
    this.to = Math.min(this.from + span, this.length - 1);
  }
}
