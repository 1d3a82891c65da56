// @ts-check
/**
 * The page inside another one: `?embed=ORIGIN` hides the masthead and talks with the page around it
 * by `postMessage`, and with nobody but that origin. What is said is documented in
 * docs/embedding.md.
 */

import { messageOf } from "./errors.js";
import { byId, h } from "./ui/dom.js";
import { version } from "./pkg/index.js";

/**
 * @typedef {import("./session.js").Session} Session
 * @typedef {{ path: string, data: Blob | BufferSource | string }} GivenFile
 */

/** Of the messages; another number is another protocol. */
const PROTOCOL = 1;

/**
 * Talks with the page around this one.
 * @param {Session} session
 * @param {string} origin
 */
export function embed(session, origin) {
  const around = window.parent;
  if (origin === "" || around === window) return;
  byId("embedded").append(
    h(
      "p",
      {},
      `Shown inside ${origin}, which gets the results of the files in here. Nothing is sent ` +
        "anywhere else.",
    ),
  );
  byId("embedded").hidden = false;

  /** Of the request under way. @type {unknown} */
  let id = null;
  const say = (/** @type {Record<string, unknown>} */ message) =>
    around.postMessage({ tracklens: PROTOCOL, id, ...message }, origin);

  const complain = () => {
    const problems = [
      ...session.problems.all.map(({ text }) => text),
      ...session.library.broken.map(({ error }) => error),
      ...session.needs.filter(({ met }) => !met).map(({ label }) => `needed for a score: ${label}`),
    ];
    say({ type: "problem", problems });
  };

  window.addEventListener("message", async ({ data, source, origin: from }) => {
    if (source !== around || from !== origin || data?.tracklens !== PROTOCOL) return;
    id = data.id ?? null;
    try {
      if (data.type === "clear") {
        session.clear();
        return;
      }
      if (data.type !== "open" && data.type !== "add") {
        throw new Error(
          `a message of type ${JSON.stringify(data.type)}; expected "open", "add" or "clear"`,
        );
      }
      const sources = filesOf(data.files);
      if (data.type === "open") session.clear();
      applyOptions(session, data.options ?? {});
      await session.add(sources);
      if (!session.score.evaluation && session.extraction?.status !== "running") complain();
    } catch (error) {
      say({ type: "problem", problems: [messageOf(error)] });
    }
  });

  session.score.addEventListener("evaluation", () => {
    if (session.score.evaluation) say({ type: "result", evaluation: session.score.evaluation });
  });
  session.addEventListener("extraction", () => {
    const { extraction, frameSources } = session;
    if (extraction?.status === "failed") say({ type: "problem", problems: [extraction.error] });
    else if (extraction?.status === "running") {
      say({
        type: "progress",
        done: extraction.extracted.size + extraction.failures.size,
        total: frameSources.length,
      });
    }
  });
  say({ type: "ready", version: version() });
}

/**
 * @param {unknown} files
 * @returns {import("./files/sources.js").Source[]}
 */
function filesOf(files) {
  if (!Array.isArray(files)) throw new Error("`files` is no array; expected [{ path, data }, …]");
  return files.map((/** @type {GivenFile} */ file, i) => {
    const { path, data } = file ?? {};
    const isData =
      data instanceof Blob ||
      data instanceof ArrayBuffer ||
      ArrayBuffer.isView(data) ||
      typeof data === "string";
    if (typeof path !== "string" || path === "" || !isData) {
      throw new Error(
        `files[${i}]: expected { path: "folder/name", data: Blob, ArrayBuffer, typed array or ` +
          "text }",
      );
    }
    return { path, blob: data instanceof Blob ? data : new Blob([data]) };
  });
}

/**
 * @param {Session} session
 * @param {import("./pkg/index.js").ScoreOptions} options
 */
function applyOptions(session, { transform, rank, thresholds }) {
  if (transform || rank)
    session.score.setOptions({ ...(transform && { transform }), ...(rank && { rank }) });
  for (const [object, threshold] of Object.entries(thresholds ?? {}))
    session.score.setThreshold(object, threshold);
}
