// @ts-check
/**
 * Questions about the data that are asked before a number is shown: the package says what looks
 * wrong and what would put it right, and a click does it or leaves everything as it is.
 */

import { announce, byId, fill, h, prose } from "../ui/dom.js";
import { sentence } from "../ui/format.js";
import { labelOf } from "./remedies.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../pkg/index.js").Finding} Finding
 * @typedef {import("../pkg/index.js").Remedy} Remedy
 */

/** @type {Record<Finding["problem"], string>} */
const QUESTIONS = {
  unit: "Which unit is this?",
  counting: "Do both sides count the same frames?",
  "first-rows": "Rows are missing",
  lag: "Are the tables out of step?",
  axes: "Are the axes turned?",
  zeros: "Were these points not found?",
  still: "This object does not move",
};

/** @param {Session} session */
export function showDoctor(session) {
  const place = byId("doctor");
  let shown = "";
  const update = () => {
    const { questions } = session;
    place.hidden = questions.length === 0;
    const now = questions.map(({ text }) => text).join("\n");
    if (now === shown) return;
    shown = now;
    if (place.hidden) {
      fill(place);
      return;
    }
    fill(
      place,
      h("h2", { id: "doctor-title" }, "Before the score"),
      h("p", { class: "hint" }, "Something looks odd. Nothing is changed unless you say so."),
      h("ul", { class: "questions" }, ...questions.map((finding) => question(session, finding))),
    );
    announce(`Before the score: ${questions.map(({ text }) => text).join(" ")}`);
  };
  for (const topic of ["files", "extraction"]) session.addEventListener(topic, update);
}

/**
 * @param {Session} session
 * @param {Finding} finding
 */
function question(session, finding) {
  const { problem, text, remedies } = finding;
  const answer = (/** @type {string} */ label, /** @type {Remedy | null} */ remedy) =>
    h(
      "button",
      {
        type: "button",
        class: "button",
        data: { kind: remedy === remedies[0] ? "primary" : "quiet", remedy: remedy ? "" : "none" },
        onclick: () => void session.answer(finding, remedy),
      },
      label,
    );
  return h(
    "li",
    { class: "question", data: { problem } },
    h("h3", {}, QUESTIONS[problem]),
    h("p", {}, ...prose(sentence(text))),
    h(
      "div",
      { class: "actions" },
      ...remedies.map((remedy) => answer(labelOf(remedy), remedy)),
      answer(problem === "unit" ? "It is right as it is" : "Leave it as it is", null),
    ),
  );
}
