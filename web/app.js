// @ts-check
/** The application: one session, its views, and what the user does to the whole page. */

import { version } from "./pkg/index.js";
import { DeviceExtractor } from "./extraction/device-extractor.js";
import { announce, byId } from "./ui/dom.js";
import { listenToTabs } from "./ui/tabs.js";
import { fetchExample } from "./files/example.js";
import { WorkerPool } from "./extraction/pool.js";
import { showFiles } from "./files/view.js";
import { fromDrop, fromInput } from "./files/sources.js";
import { keepOffline } from "./offline.js";
import { Session } from "./session.js";

/** Starts the page; the scoring part of the package is loaded. */
export function start() {
  const origin = embedder();
  const allowSoftware = new URLSearchParams(location.search).get("gpu") === "software";
  const devices = new DeviceExtractor(new WorkerPool(), allowSoftware);
  const session = new Session(devices, { remembers: origin === null });
  listenToTabs(byId("tabs"));
  showFiles(session);
  // Files can be taken while the views of what is in them are fetched.
  session.hold(
    import("./views.js").then(({ showViews }) => showViews(session, devices, origin === null)),
  );
  takeFiles(session);
  showState(session);
  byId("version").textContent = `tracklens ${version()}`;
  if (origin !== null) void import("./embed.js").then(({ embed }) => embed(session, origin));
  if (new URLSearchParams(location.search).has("example")) void session.open(fetchExample);
  void keepOffline();
}

/**
 * The origin that the page is embedded for; `null` when it is not embedded, empty when it talks
 * with nobody. Only http and https have origins that messages can be sent to: that of `data:` and
 * `file:` is "null".
 */
function embedder() {
  const given = new URLSearchParams(location.search).get("embed");
  if (given === null) return null;
  try {
    const { protocol, origin } = new URL(given);
    return ["http:", "https:"].includes(protocol) ? origin : "";
  } catch {
    return "";
  }
}

/** @param {Session} session */
function takeFiles(session) {
  for (const [button, input] of [
    ["choose-files", "input-files"],
    ["choose-folder", "input-folder"],
  ]) {
    /** @type {HTMLInputElement} */
    const picker = byId(input);
    byId(button).addEventListener("click", () => picker.click());
    picker.addEventListener("change", () => {
      void session.add(fromInput(picker));
      // The same files can be picked again.
      picker.value = "";
    });
  }
  byId("try-example").addEventListener("click", () => void session.open(fetchExample));
  byId("start-over").addEventListener("click", () => {
    session.clear();
    announce("Everything was removed.");
    byId("choose-folder").focus();
  });
  byId("go-export").addEventListener("click", () => {
    const tab = byId("tab-export");
    tab.click();
    tab.scrollIntoView({ block: "start" });
    tab.focus({ preventScroll: true });
  });
  for (const id of ["choose-files", "choose-folder", "try-example"]) {
    /** @type {HTMLButtonElement} */ (byId(id)).disabled = false;
  }

  const overlay = byId("overlay");
  // Entering a child fires before leaving its parent, so it takes a count to know that the page was
  // left.
  let depth = 0;
  const isFiles = (/** @type {DragEvent} */ event) =>
    event.dataTransfer?.types.includes("Files") ?? false;
  const over = (/** @type {number} */ next) => {
    depth = Math.max(0, next);
    overlay.hidden = depth === 0;
  };
  window.addEventListener("dragenter", (event) => isFiles(event) && over(depth + 1));
  window.addEventListener("dragleave", (event) => isFiles(event) && over(depth - 1));
  window.addEventListener("drop", (event) => {
    over(0);
    if (event.dataTransfer && isFiles(event)) void session.add(fromDrop(event.dataTransfer));
  });
}

/**
 * What the layout depends on, as `data-state` of the main element: `empty`, `waiting` (for files or
 * the user), `reading`, `extracting`, `scored`.
 * @param {Session} session
 */
function showState(session) {
  const main = byId("main");
  const update = () => {
    const taken = session.library.size + session.library.runs.size > 0;
    const before = main.dataset.state;
    let state = taken ? "waiting" : "empty";
    if (session.score.evaluation) state = "scored";
    if (session.extraction?.status === "running") state = "extracting";
    if (session.reading) state = "reading";
    if (state === before) return;
    main.dataset.state = state;
    byId("start-over").hidden = state === "empty";
    byId("go-export").hidden = session.score.evaluation === null;
    byId("workspace").hidden = state === "empty";
    if (state === "empty") announce("");
  };
  for (const topic of ["files", "reading", "extraction"]) session.addEventListener(topic, update);
  for (const topic of ["scoring", "evaluation"]) session.score.addEventListener(topic, update);
  update();
}
