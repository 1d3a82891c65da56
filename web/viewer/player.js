// @ts-check
/** Which frame is on display: steps, jumps and playing. */

/** @typedef {import("../session.js").Session} Session */

/** Frames decoded ahead of the one on display while playing or moving. */
const AHEAD = 4;
/** Frames that a key moves with the shift key. */
const FAR = 10;

export class Player {
  #score;
  #prepare;
  #look;
  #onPlaying;
  #isPlaying = false;
  /** When the next frame is due. */
  #due = 0;
  /** The frame that this player went to last. */
  #own = -1;

  /**
   * @param {Session} session
   * @param {(frame: number) => void} prepare decodes a frame that is shown soon
   * @param {{ speed: number }} look
   * @param {(isPlaying: boolean) => void} onPlaying
   */
  constructor({ score }, prepare, look, onPlaying) {
    this.#score = score;
    this.#prepare = prepare;
    this.#look = look;
    this.#onPlaying = onPlaying;
  }

  /** The sequence on display. */
  get sequence() {
    return this.#score.sequenceOf(this.#score.selection.frame);
  }

  /** The position of the frame in its sequence. */
  get index() {
    return this.#score.selection.frame - (this.sequence?.start ?? 0);
  }

  /** @param {number} to in the sequence on display */
  #goTo(to) {
    const range = this.sequence;
    if (!range) return;
    const next = Math.min(Math.max(to, 0), range.length - 1);
    this.#select(range.start + next);
  }

  /** @param {number} frame */
  #select(frame) {
    this.#own = frame;
    this.#score.select({ frame });
  }

  /**
   * Goes to a frame that the user asks for and stays there. Those that come next if the movement
   * goes on are decoded meanwhile.
   * @param {number} to in the sequence on display
   */
  moveTo(to) {
    this.play(false);
    const before = this.index;
    this.#goTo(to);
    const range = this.sequence;
    const step = this.index - before;
    // After a jump nobody knows where the next one leads.
    if (!range || step === 0 || Math.abs(step) > FAR) return;
    for (let ahead = 1; ahead <= AHEAD; ahead++) {
      const next = this.index + ahead * step;
      if (next >= 0 && next < range.length) this.#prepare(range.start + next);
    }
  }

  /** @param {number} by frames */
  step(by) {
    this.moveTo(this.index + by);
  }

  /** @param {number} by sequences */
  goToSequence(by) {
    const { sequences } = this.#score;
    const range = this.sequence;
    const at = range ? sequences.indexOf(range) : 0;
    const next = sequences[Math.min(Math.max(at + by, 0), sequences.length - 1)];
    if (next && next !== range) this.show(next);
  }

  /**
   * Goes to a sequence, and goes on playing there.
   * @param {import("../pkg/index.js").SequenceRange} sequence
   */
  show({ start }) {
    this.#select(start);
  }

  /** Something else may have moved: the player stops where that leads to. */
  follow() {
    if (this.#isPlaying && this.#score.selection.frame !== this.#own) this.play(false);
  }

  toggle() {
    this.play(!this.#isPlaying);
  }

  /** @param {boolean} isWanted */
  play(isWanted) {
    const wasPlaying = this.#isPlaying;
    this.#isPlaying = isWanted && this.#score.shown !== null;
    if (this.#isPlaying !== wasPlaying) this.#onPlaying(this.#isPlaying);
    if (!this.#isPlaying || wasPlaying) return;
    this.#own = this.#score.selection.frame;
    this.#due = performance.now();
    requestAnimationFrame(this.#tick);
  }

  /** @param {number} now */
  #tick = (now) => {
    if (!this.#isPlaying) return;
    const range = this.sequence;
    if (!range) {
      this.play(false);
      return;
    }
    if (now >= this.#due) this.#advance(range, now);
    requestAnimationFrame(this.#tick);
  };

  /**
   * @param {import("../pkg/index.js").SequenceRange} range
   * @param {number} now
   */
  #advance({ start, length }, now) {
    const { speed } = this.#look;
    const interval = 1000 / speed;
    // Faster than the display some frames are left out. After a longer hitch what was missed is not
    // made up for.
    const missed = 1 + Math.floor((now - this.#due) / interval);
    const steps = Math.min(missed, Math.max(1, Math.ceil(speed / 10)));
    this.#due = Math.max(this.#due + steps * interval, now);
    this.#goTo((this.index + steps) % length);
    for (let ahead = 1; ahead <= Math.min(AHEAD, length - 1); ahead++) {
      this.#prepare(start + ((this.index + ahead * steps) % length));
    }
  }

  /**
   * Whether the key was one of these.
   * @param {KeyboardEvent} event
   */
  key({ key, shiftKey }) {
    const step = shiftKey ? FAR : 1;
    if (key === " ") this.toggle();
    else if (key === "ArrowRight") this.step(step);
    else if (key === "ArrowLeft") this.step(-step);
    else if (key === "Home") this.moveTo(0);
    else if (key === "End") this.moveTo(Infinity);
    else if (key === "PageUp") this.goToSequence(-1);
    else if (key === "PageDown") this.goToSequence(1);
    else return false;
    return true;
  }
}
