// In the page before its own script: tells when something is painted, when it can be used, when the
// first TC is there, of the bundled example or of two tables that are dropped (?tables), how long
// after the click or the drop its frames move, and the longest task of the page's own thread until
// the TC.
const $ = (selector) => document.querySelector(selector);
const post = (path, body) => fetch(path, { method: "POST", body: JSON.stringify(body ?? {}) });

/** Resolves with the time at which `condition` holds, which is looked at whenever attributes change. */
const when = (condition) =>
  new Promise((resolve) => {
    const observer = new MutationObserver(() => {
      if (!condition()) return;
      observer.disconnect();
      resolve(performance.now());
    });
    observer.observe(document.body, { attributes: true, subtree: true });
  });

let longest = 0;
const tasks = new PerformanceObserver((list) => {
  for (const { duration } of list.getEntries()) longest = Math.max(longest, duration);
});
tasks.observe({ type: "longtask", buffered: true });

const interactive = await when(() => !$("#try-example").disabled);
const scored = when(() => $("#results").dataset.tc !== undefined);
let start = 0;
if (new URLSearchParams(location.search).has("tables")) {
  const transfer = new DataTransfer();
  for (const name of ["ground_truth.csv", "keypoints.csv"]) {
    transfer.items.add(new File([await (await fetch(`/made/${name}`)).blob()], name));
  }
  await post("/mark");
  start = performance.now();
  window.dispatchEvent(new DragEvent("drop", { dataTransfer: transfer }));
} else {
  await post("/mark");
  $("#try-example").click();
}
const clicked = performance.now();
const tc = await scored;
const shown = $("#stage").dataset.frame;
const moving = when(() => $("#stage").dataset.frame !== shown);
// A task is told of once it has ended.
await new Promise((resolve) => setTimeout(resolve, 200));
const until = longest;
const [paint] = performance.getEntriesByName("first-contentful-paint");
await post("/result", {
  ...{ paint: paint?.startTime, interactive, milliseconds: tc - start, longest: until },
  moving: (await moving) - clicked,
});
