// @ts-check
/** Export of the results: files, and the command that repeats them. */

import init, {
  evaluationCsv,
  evaluationPage,
  evaluationTex,
  evaluationText,
} from "../pkg/index.js";
import { messageOf } from "../errors.js";
import { copyButton } from "../ui/copy.js";
import { h, icon } from "../ui/dom.js";
import { save } from "../ui/download.js";
import { integer, sentence } from "../ui/format.js";
import { filmOf } from "../viewer/film.js";

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
  const complete = (/** @type {(evaluation: Evaluation) => unknown} */ write) => async () => {
    await init(["figures"]);
    const evaluation = session.score.completeEvaluation();
    if (evaluation) await write(evaluation);
  };
  const downloads = [
    item(
      "save-report",
      "Report (HTML)",
      complete(async (evaluation) => {
        const film = await filmOf(session);
        save("report.html", "text/html", evaluationPage(evaluation, film));
      }),
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
  const { isInSpace, scoring } = session.score;
  const video = scoring && !isInSpace ? videoButton(session) : null;
  const repeat = repeatView(session);
  const element = h(
    "section",
    { class: "panel taking", "aria-labelledby": "taking-title" },
    h("h3", { id: "taking-title" }, "Export"),
    h("div", { class: "downloads" }, ...downloads, video?.button),
    video?.problem,
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
  const replay = session.table && replayButton(session);
  return h(
    "div",
    { class: "repeat" },
    h("h4", {}, "Share"),
    h("div", { class: "downloads" }, copy, replay?.button),
    replay?.problem,
    h(
      "p",
      { class: "hint-line" },
      "The file has the settings, the keypoints, the ground truth and small images; dropped on " +
        "this page, it shows the score as it is here.",
    ),
    h("div", { class: "command" }, link),
  );
}

/**
 * Everything as one file, made of the settings, the tables and small images.
 * @param {Session} session
 */
function replayButton(session) {
  return slowDownload(
    session,
    "save-replay",
    "Everything in one file",
    async (progress, signal) => {
      const { replayOf } = await import("../files/replay.js");
      return { name: "tracklens.zip", blob: await replayOf(session, progress, signal) };
    },
  );
}

/**
 * The sequence on display as a video.
 * @param {Session} session
 */
function videoButton(session) {
  return slowDownload(session, "save-video", "This sequence (video)", async (progress, signal) => {
    const { videoOf } = await import("../viewer/save-video.js");
    return videoOf(session, progress, signal);
  });
}

/**
 * A button that saves what takes a while to make. Meanwhile it says how far that is, and a click
 * ends it; so do other files.
 * @param {Session} session
 * @param {string} id
 * @param {string} label
 * @param {(progress: (done: number, total: number) => void, signal: AbortSignal) =>
 * Promise<{ name: string, blob: Blob }>} make
 */
function slowDownload({ score }, id, label, make) {
  const text = h("span", {}, label);
  const problem = h("p", { class: "hint-line", role: "alert" });
  /** @type {AbortController | null} */
  let work = null;
  const start = async () => {
    const mine = new AbortController();
    work = mine;
    const { signal } = mine;
    score.addEventListener("scoring", () => mine.abort(), { signal });
    problem.textContent = "";
    try {
      const { name, blob } = await make((done, total) => {
        text.textContent = `Frame ${integer(done + 1)} of ${integer(total)}; cancel`;
      }, signal);
      save(name, blob.type, blob);
    } catch (error) {
      if (!signal.aborted) problem.textContent = sentence(messageOf(error));
    } finally {
      mine.abort();
      work = null;
      text.textContent = label;
    }
  };
  const onclick = () => (work ? work.abort() : void start());
  const button = h(
    "button",
    { id, type: "button", class: "button", onclick },
    icon("icon-download"),
    text,
  );
  return { button, problem };
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
