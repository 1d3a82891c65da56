// @ts-check
/** Export of the results: files, and the command that repeats them. */

import init, { evaluationCsv, evaluationPage } from "../pkg/index.js";
import { announce, h, icon } from "../ui/dom.js";
import { save } from "../ui/download.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../pkg/index.js").Evaluation} Evaluation
 */

/** How long the button says that it has copied. */
const COPIED_MS = 2000;

/** @param {Session} session */
export function exportView(session) {
  const item = (
    /** @type {string} */ id,
    /** @type {string} */ label,
    /** @type {() => void} */ onclick,
  ) => h("button", { id, type: "button", class: "button", onclick }, icon("icon-download"), label);
  const complete = (/** @type {(evaluation: Evaluation) => void} */ write) => async () => {
    await init(["figures"]);
    const evaluation = session.score.completeEvaluation();
    if (evaluation) write(evaluation);
  };
  const command = h("code", { id: "command" });
  const copied = h("span", {}, "Copy");
  const copy = h(
    "button",
    {
      type: "button",
      class: "button",
      id: "copy-command",
      onclick: async () => {
        try {
          await navigator.clipboard.writeText(command.textContent ?? "");
          copied.textContent = "Copied";
          announce("The command was copied.");
          setTimeout(() => (copied.textContent = "Copy"), COPIED_MS);
        } catch {
          // Without leave to write to the clipboard, the text is ready to be copied by hand.
          getSelection()?.selectAllChildren(command);
        }
      },
    },
    copied,
  );
  const repeat = h(
    "div",
    { class: "repeat" },
    h("h4", {}, "The same in the terminal"),
    h("div", { class: "command" }, h("pre", { tabIndex: 0 }, command), copy),
  );
  const element = h(
    "section",
    { class: "panel taking", "aria-labelledby": "taking-title" },
    h("h3", { id: "taking-title" }, "Export"),
    h(
      "div",
      { class: "downloads" },
      item(
        "save-report",
        "Report (HTML)",
        complete((evaluation) => save("report.html", "text/html", evaluationPage(evaluation))),
      ),
      item(
        "save-evaluation",
        "Evaluation (JSON)",
        complete((evaluation) =>
          save("evaluation.json", "application/json", `${JSON.stringify(evaluation, null, 2)}\n`),
        ),
      ),
      item(
        "save-table",
        "Table (CSV)",
        complete((evaluation) => save("evaluation.csv", "text/csv", evaluationCsv(evaluation))),
      ),
      session.table &&
        item("save-keypoints", "Keypoints (CSV)", () =>
          save("keypoints.csv", "text/csv", session.table?.toCsv() ?? ""),
        ),
    ),
    h("p", { class: "hint-line" }, "Each figure has its own links to save it."),
    repeat,
  );
  const update = () => {
    command.textContent = session.score.command();
    repeat.hidden = command.textContent === "";
  };
  return { element, update };
}
