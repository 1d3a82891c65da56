// @ts-check
/** What is wrong, above everything else: in the session, and in files that cannot be used. */

import { announce, byId, fill, notice } from "../ui/dom.js";
import { baseName, count } from "../ui/format.js";
import { reveal } from "../ui/tabs.js";

/** @typedef {import("../session.js").Session} Session */

const LISTED_BROKEN = 3;

/**
 * @param {Session} session
 */
export function showProblems(session) {
  const place = byId("problems");
  // A problem that stays keeps its element, so that it is not announced again.
  const before = new Map(
    Array.from(place.children, (child) => {
      const { problem, text } = /** @type {HTMLElement} */ (child).dataset;
      return [`${problem} ${text}`, child];
    }),
  );
  const elements = problemsOf(session).map(({ key, kind, text, action, dismiss }) => {
    const known = before.get(`${key} ${text}`);
    // What the problem of this name asks for when it is clicked: files may have been replaced since
    // it was first told.
    const now = () => problemsOf(session).find((problem) => problem.key === key);
    const element =
      known ??
      notice(kind, text, {
        action: action && { label: action.label, run: () => now()?.action?.run() },
        dismiss: dismiss && (() => now()?.dismiss?.()),
      });
    // An error is an alert, which speaks for itself.
    if (!known && kind !== "error") announce(text);
    Object.assign(/** @type {HTMLElement} */ (element).dataset, { problem: key, text });
    return element;
  });
  if (
    elements.length !== place.children.length ||
    elements.some((element, i) => element !== place.children[i])
  ) {
    fill(place, ...elements);
  }
}

/**
 * @param {Session} session
 * @returns {(import("./problems.js").Problem & { key: string, dismiss?: () => void })[]}
 */
function problemsOf(session) {
  const { broken } = session.library;
  const left = broken.length - LISTED_BROKEN;
  return [
    ...session.problems.all.map((problem) => ({
      ...problem,
      dismiss: () => session.problems.dismiss(problem.key),
    })),
    ...broken.slice(0, LISTED_BROKEN).map((file) => ({
      key: `broken ${file.path}`,
      kind: /** @type {const} */ ("error"),
      text: file.error,
      action: {
        label: `Show ${baseName(file.path)} among the files`,
        run: () => showFile(file.path),
      },
      dismiss: () => session.dismissError(file.path),
    })),
    ...(left > 0
      ? [
          {
            key: "broken",
            kind: /** @type {const} */ ("error"),
            text: `${count(left, "more file")} cannot be used; the list of files says why.`,
            action: { label: "Show the files", run: () => showFile("") },
          },
        ]
      : []),
  ];
}

/**
 * Brings a file of the list into sight.
 * @param {string} path
 */
function showFile(path) {
  const files = /** @type {HTMLElement[]} */ ([...byId("files").children]);
  const item = files.find(({ dataset }) => dataset.path === path) ?? byId("files-title");
  reveal(item);
  item.tabIndex = -1;
  item.scrollIntoView({ block: "center" });
  // What is missing can be entered at once.
  const field = /** @type {HTMLElement | null} */ (item.querySelector(".image-size input"));
  (field ?? item).focus({ preventScroll: true });
}
