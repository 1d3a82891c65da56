// @ts-check
/** Positions of objects that somebody marks by hand, frame by frame, with undo and redo. */

/**
 * Where an object is in ndc, or that it cannot be seen.
 * @typedef {{ x: number, y: number } | "hidden"} Mark
 *
 * A frame by its sequence and its number in it.
 * @typedef {{ key: string, sequence: string, number: number }} Frame
 *
 * What is marked: of each frame by its key, a mark an object; `null` where there is none yet.
 * @typedef {{ objects: readonly string[], frames: ReadonlyMap<string, readonly (Mark | null)[]> }}
 * State
 */

const FIRST = "object 1";

/** Its event is `change`. */
export class Marks extends EventTarget {
  /** @type {State} */
  #state;
  /** States before, with the frame that the change was made in. @type {Step[]} */
  #past = [];
  /** States that were undone. @type {Step[]} */
  #future = [];

  /** @typedef {{ state: State, key: string }} Step */

  /** @param {State | null} state of an earlier visit */
  constructor(state) {
    super();
    this.#state = state ?? { objects: [FIRST], frames: new Map() };
  }

  get state() {
    return this.#state;
  }

  get objects() {
    return this.#state.objects;
  }

  get canUndo() {
    return this.#past.length > 0;
  }

  get canRedo() {
    return this.#future.length > 0;
  }

  /**
   * The marks of a frame, one an object.
   * @param {string} key
   * @returns {readonly (Mark | null)[]}
   */
  of(key) {
    return this.#state.frames.get(key) ?? this.objects.map(() => null);
  }

  /**
   * Whether anything is marked in a frame.
   * @param {string} key
   */
  has(key) {
    return this.#state.frames.has(key);
  }

  /**
   * Whether every object of a frame is marked or said not to be visible.
   * @param {string} key
   */
  isComplete(key) {
    const marks = this.#state.frames.get(key);
    return marks !== undefined && marks.every((mark) => mark !== null);
  }

  /**
   * @param {string} key
   * @param {number} object
   * @param {Mark | null} mark `null` takes it back
   */
  set(key, object, mark) {
    const frames = new Map(this.#state.frames);
    frames.set(key, replaced(this.of(key), object, mark));
    this.#change({ objects: this.objects, frames }, key);
  }

  /**
   * Adds an object, which no frame has a mark of yet.
   * @param {string} key the frame on display
   */
  addObject(key) {
    let number = this.objects.length + 1;
    while (this.objects.includes(`object ${number}`)) number++;
    this.#change(
      this.#with([...this.objects, `object ${number}`], (marks) => [...marks, null]),
      key,
    );
  }

  /**
   * @param {number} object
   * @param {string} name
   * @param {string} key the frame on display
   */
  rename(object, name, key) {
    this.#change(
      this.#with(replaced(this.objects, object, name), (marks) => marks),
      key,
    );
  }

  /**
   * Removes an object with its marks.
   * @param {number} object
   * @param {string} key the frame on display
   */
  removeObject(object, key) {
    const isKept = (/** @type {unknown} */ _, /** @type {number} */ i) => i !== object;
    const objects = this.objects.filter(isKept);
    this.#change(
      this.#with(objects, (marks) => marks.filter(isKept)),
      key,
    );
  }

  /**
   * Removes all marks; the objects stay.
   * @param {string} key the frame on display
   */
  removeAll(key) {
    this.#change({ objects: this.objects, frames: new Map() }, key);
  }

  /**
   * Takes the last change back.
   * @returns {string | null} the frame that it was made in
   */
  undo() {
    return this.#go(this.#past, this.#future);
  }

  /**
   * Makes a change again that was taken back.
   * @returns {string | null} the frame that it was made in
   */
  redo() {
    return this.#go(this.#future, this.#past);
  }

  /**
   * @param {Step[]} from
   * @param {Step[]} to
   */
  #go(from, to) {
    const step = from.pop();
    if (!step) return null;
    to.push({ state: this.#state, key: step.key });
    this.#state = step.state;
    this.dispatchEvent(new Event("change"));
    return step.key;
  }

  /**
   * @param {readonly string[]} objects
   * @param {(marks: readonly (Mark | null)[]) => readonly (Mark | null)[]} marksOf
   * @returns {State}
   */
  #with(objects, marksOf) {
    const frames = [...this.#state.frames].map(
      ([key, marks]) => /** @type {const} */ ([key, marksOf(marks)]),
    );
    return { objects, frames: new Map(frames) };
  }

  /**
   * @param {State} state
   * @param {string} key
   */
  #change(state, key) {
    this.#past.push({ state: this.#state, key });
    this.#future = [];
    this.#state = state;
    this.dispatchEvent(new Event("change"));
  }
}

/**
 * The marks as a table of one row a point, in ndc and in the order of the frames. What is not
 * visible has a row without a position.
 * @param {Marks} marks
 * @param {Frame[]} frames
 */
export function csvOf(marks, frames) {
  const rows = frames.flatMap(({ key, sequence, number }) =>
    marks.of(key).flatMap((mark, object) => {
      if (mark === null) return [];
      const at = mark === "hidden" ? "," : `${mark.x},${mark.y}`;
      return [`${field(sequence)},${number},${field(marks.objects[object])},${at}`];
    }),
  );
  return ["sequence,frame,object,x,y", ...rows, ""].join("\n");
}

/**
 * A copy with another item in one place.
 * @template T
 * @param {readonly T[]} items
 * @param {number} at
 * @param {T} item
 */
function replaced(items, at, item) {
  return items.map((each, i) => (i === at ? item : each));
}

/**
 * A field, in quotes where it needs them.
 * @param {string} text
 */
function field(text) {
  return /[",;\t\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}
