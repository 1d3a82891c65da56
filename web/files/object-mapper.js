// @ts-check
/** A recording whose arrays have names of sensors: which of them is which object, said by the user. */

import { messageOf } from "../errors.js";
import { fill, h } from "../ui/dom.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("./intake.js").Container} Container
 * @typedef {import("./containers/npz.js").Objects} Objects
 * @typedef {import("../pkg/index.js").TableOptions} TableOptions
 *
 * What the user says of an object.
 * @typedef {{ name: string, array: string, numbers: string }} Row
 */

const UNITS = /** @type {const} */ ([
  ["", "choose…"],
  ["px", "pixels"],
  ["ndc", "ndc, −1 to +1"],
  ["fraction", "0 to 1"],
]);
/** Some numbers of an array: from the first to before the last. */
const NUMBERS = /^\s*(\d+)\s*:\s*(\d+)\s*$/;

/**
 * Asks which array is which object.
 * @param {Session} session
 * @param {Container} container
 * @param {Objects} objects
 */
export function objectMapper(session, container, objects) {
  const rows = h("div", { class: "mapper-rows" });
  const problem = h("p", { class: "hint", role: "status" });
  const size = sizeFields();
  const unit = h(
    "select",
    { name: "unit", onchange: () => (size.element.hidden = unit.value !== "px") },
    ...UNITS.map(([value, label]) => h("option", { value }, label)),
  );
  size.element.hidden = true;
  const ofUnit = h(
    "div",
    { class: "corrections" },
    h("label", { class: "choice" }, h("span", {}, "Unit"), unit),
    size.element,
  );
  const said = () => [...rows.children].map(rowOf);
  const update = () => {
    ofUnit.hidden = said().every(({ numbers }) => countOf(numbers) !== 2);
  };
  const add = () => {
    const { length } = rows.children;
    const { name, shape } = objects.arrays[Math.min(length, objects.arrays.length - 1)];
    rows.append(objectRow(objects, length, name, shape, update));
    update();
  };
  const apply = async () => {
    try {
      const columns = columnsOf(said());
      const options = ofUnit.hidden ? {} : unitOf(unit.value, size.read());
      await session.nameObjects(container, columns, options);
      fill(problem);
    } catch (error) {
      fill(problem, messageOf(error));
    }
  };
  add();
  return h(
    "div",
    { class: "corrections object-mapper" },
    rows,
    h(
      "button",
      { type: "button", class: "link", name: "add-object", onclick: add },
      "Add an object",
    ),
    ofUnit,
    problem,
    h(
      "button",
      { type: "button", class: "button", name: "apply-objects", onclick: () => void apply() },
      "Read it like this",
    ),
  );
}

/**
 * @param {Objects} objects
 * @param {number} i
 * @param {string} array
 * @param {number[]} shape
 * @param {() => void} onChange
 */
function objectRow({ arrays }, i, array, shape, onChange) {
  const label = (/** @type {string} */ what) => `${what} of object ${i + 1}`;
  const numbers = h("input", {
    name: "object-numbers",
    class: "text-field",
    value: usualNumbers(shape),
    "aria-label": label("Numbers"),
    title: "Which numbers of a row: 0:3 is the first three",
    size: "5",
    oninput: onChange,
  });
  const select = h(
    "select",
    {
      name: "object-array",
      "aria-label": label("Array"),
      onchange: () => {
        const chosen = arrays.find(({ name }) => name === select.value);
        numbers.value = usualNumbers(chosen?.shape ?? []);
        onChange();
      },
    },
    ...arrays.map(({ name, shape }) =>
      h("option", { value: name, selected: name === array }, `${name} [${shape.join(", ")}]`),
    ),
  );
  const name = h("input", {
    name: "object-name",
    class: "text-field",
    placeholder: "object",
    "aria-label": label("Name"),
    size: "8",
  });
  return h("div", { class: "mapper-row" }, name, select, numbers);
}

/**
 * @param {Element} row
 * @returns {Row}
 */
function rowOf(row) {
  const value = (/** @type {string} */ name) =>
    /** @type {HTMLInputElement} */ (row.querySelector(`[name="${name}"]`)).value.trim();
  return {
    name: value("object-name"),
    array: value("object-array"),
    numbers: value("object-numbers"),
  };
}

/**
 * All numbers of a row where they can be a position, or else the first three.
 * @param {number[]} shape
 */
function usualNumbers(shape) {
  return `0:${Math.min(shape[shape.length - 1] ?? 0, 3)}`;
}

/** @param {string} numbers */
function countOf(numbers) {
  const [, start, end] = NUMBERS.exec(numbers) ?? [];
  return Number(end) - Number(start);
}

/**
 * As the terminal takes it with `--columns`.
 * @param {Row[]} rows
 */
function columnsOf(rows) {
  const named = rows.filter(({ name }) => name !== "");
  if (named.length === 0) throw new Error("Give an object its name, e.g. cube.");
  for (const { name, numbers } of named) {
    if (/[=,]/.test(name)) throw new Error(`${name} has a comma or an equals sign; leave it out.`);
    if (!NUMBERS.test(numbers)) {
      throw new Error(`${numbers || "Nothing"} for ${name}; expected numbers as 0:3.`);
    }
  }
  return named.map(({ name, array, numbers }) => `${name}=${array}[${numbers}]`).join(",");
}

/**
 * @param {string} space
 * @param {[number, number]} imageSize
 * @returns {TableOptions}
 */
function unitOf(space, imageSize) {
  if (space === "") throw new Error("Choose the unit of the positions.");
  if (space !== "px") return { space: /** @type {TableOptions["space"]} */ (space) };
  if (!imageSize.every((side) => Number.isInteger(side) && side > 0)) {
    throw new Error("Give the size of what the pixels lie on.");
  }
  return { space, imageSize };
}

/** The size of what pixels lie on, which need not be that of the frames. */
function sizeFields() {
  const side = (/** @type {string} */ name, /** @type {string} */ label) =>
    h("input", { type: "number", name, min: "1", step: "1", "aria-label": label });
  const sides = [side("board-width", "Width in pixels"), side("board-height", "Height in pixels")];
  const element = h("span", { class: "image-size-sides" }, "across", sides[0], "×", sides[1], "px");
  const read = () => /** @type {[number, number]} */ (sides.map((input) => input.valueAsNumber));
  return { element, read };
}
