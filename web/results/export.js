// @ts-check
/** Export of the results: files, and the command that repeats them. */

import init, {
  evaluationCsv,
  evaluationPage,
  evaluationTex,
  evaluationText,
} from "../pkg/index.js";
import { copyButton } from "../ui/copy.js";
import { h, icon } from "../ui/dom.js";
import { save } from "../ui/download.js";
import { integer } from "../ui/format.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../pkg/index.js").Evaluation} Evaluation
 */

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
  const downloads = [
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
  ];
  const repeat = repeatView(session);
  const element = h(
    "section",
    { class: "panel taking", "aria-labelledby": "taking-title" },
    h("h3", { id: "taking-title" }, "Export"),
    h("div", { class: "downloads" }, ...downloads),
    h("p", { class: "hint-line" }, "Each figure has its own links to save it."),
    paperView(session),
    shareView(session),
    repeat.element,
  );
  return { element, update: repeat.update };
}

/**
 * The score for a paper, as text and as LaTeX.
 * @param {Session} session
 */
function paperView(session) {
  const text = h("pre", { id: "paper", tabIndex: 0, hidden: true, "aria-label": "For a paper" });
  const button = (
    /** @type {string} */ id,
    /** @type {string} */ label,
    /** @type {(evaluation: Evaluation) => string} */ write,
  ) =>
    copyButton(id, label, text, async () => {
      await init(["figures"]);
      const evaluation = session.score.completeEvaluation();
      text.textContent = evaluation ? write(evaluation) : "";
      text.hidden = evaluation === null;
    });
  return h(
    "div",
    { class: "repeat" },
    h("h4", {}, "Copy for a paper"),
    h(
      "div",
      { class: "downloads" },
      button("copy-text", "Three lines of text", evaluationText),
      button("copy-tex", "Table in LaTeX", evaluationTex),
    ),
    h("div", { class: "command" }, text),
  );
}

/**
 * A link with the settings, and everything as one file.
 * @param {Session} session
 */
function shareView(session) {
  const link = h("pre", { id: "link", tabIndex: 0, hidden: true, "aria-label": "Link" });
  const copy = copyButton("copy-link", "Link with these settings", link, async () => {
    link.textContent = location.href;
    link.hidden = false;
  });
  return h(
    "div",
    { class: "repeat" },
    h("h4", {}, "Share"),
    h("div", { class: "downloads" }, copy, session.table && replayButton(session)),
    h(
      "p",
      { class: "hint-line" },
      "The file has the settings, the keypoints, the ground truth and small images; dropped on " +
        "this page, it shows the score as it is here.",
    ),
    h("div", { class: "command" }, link),
  );
}

/** @param {Session} session */
function replayButton(session) {
  const text = h("span", {}, "Everything in one file");
  const onclick = async () => {
    const { replayOf } = await import("../files/replay.js");
    const label = text.textContent;
    button.disabled = true;
    try {
      const blob = await replayOf(session, (done, total) => {
        text.textContent = `Image ${integer(done + 1)} of ${integer(total)}`;
      });
      save("tracklens.zip", "application/zip", blob);
    } finally {
      text.textContent = label;
      button.disabled = false;
    }
  };
  const button = h(
    "button",
    { id: "save-replay", type: "button", class: "button", onclick: () => void onclick() },
    icon("icon-download"),
    text,
  );
  return button;
}

/**
 * The command of the terminal that repeats the score.
 * @param {Session} session
 */
function repeatView(session) {
  const command = h("code", { id: "command" });
  const copy = copyButton("copy-command", "Copy", command, async () => {});
  const element = h(
    "div",
    { class: "repeat" },
    h("h4", {}, "The same in the terminal"),
    h("div", { class: "command" }, h("pre", { tabIndex: 0 }, command), copy),
  );
  const update = () => {
    command.textContent = session.score.command();
    element.hidden = command.textContent === "";
  };
  return { element, update };
}
