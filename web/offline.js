// @ts-check
/**
 * The copy of the page that works without a network: made after the first load, replaced when the
 * user agrees.
 */

import { byId, fill, h } from "./ui/dom.js";

const DELAY_MS = 2000;
/**
 * A page that stays open asks this often whether there is a newer version, when it is looked at
 * again.
 */
const ASK_EVERY_MS = 60 * 60 * 1000;

/** Where a browser or a host does not allow a copy, the page goes on without one. */
export async function keepOffline() {
  const container = navigator.serviceWorker;
  if (!container) return;
  // The copy must not compete with what the page starts with.
  await new Promise((resolve) => setTimeout(resolve, DELAY_MS));
  const url = new URL("./service-worker.js", import.meta.url);
  const registration = await container.register(url, { updateViaCache: "none" }).catch(() => null);
  if (!registration) return;

  void container.ready.then(() => {
    byId("offline").hidden = false;
  });
  const watch = (/** @type {ServiceWorker | null} */ worker) => {
    const settle = () => {
      // The first copy is no news: the page is of the same version.
      if (worker?.state === "installed" && container.controller) offer(worker);
    };
    worker?.addEventListener("statechange", settle);
    settle();
  };
  watch(registration.waiting);
  watch(registration.installing);
  registration.addEventListener("updatefound", () => watch(registration.installing));

  let asked = performance.now();
  document.addEventListener("visibilitychange", () => {
    if (document.hidden || performance.now() - asked < ASK_EVERY_MS) return;
    asked = performance.now();
    void registration.update().catch(() => {});
  });
}

/**
 * Says that a newer version is there.
 * @param {ServiceWorker} worker
 */
function offer(worker) {
  const place = byId("update");
  const text = h(
    "p",
    {},
    "A newer version of this page is ready. Files have to be dropped again after the change.",
  );
  const use = async () => {
    const answered = new MessageChannel();
    const answer = new Promise(
      (resolve) => (answered.port1.onmessage = ({ data }) => resolve(data)),
    );
    navigator.serviceWorker.addEventListener("controllerchange", () => location.reload(), {
      once: true,
    });
    worker.postMessage("activate", [answered.port2]);
    if ((await answer) === "busy") {
      text.textContent =
        "The page is open more than once. Close the others first: two versions cannot run side " +
        "by side.";
    }
  };
  fill(
    place,
    text,
    h(
      "button",
      { type: "button", id: "use-update", class: "button", onclick: () => void use() },
      "Use it now",
    ),
    h(
      "button",
      {
        type: "button",
        class: "button",
        data: { kind: "quiet" },
        onclick: () => (place.hidden = true),
      },
      "Later",
    ),
  );
  place.hidden = false;
}
