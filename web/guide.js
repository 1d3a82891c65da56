// @ts-check
/** A short look at what the example shows: three steps, once. */

import { announce, byId, fill, h } from "./ui/dom.js";
import { load, store } from "./settings.js";

/** @typedef {import("./session.js").Session} Session */

/** What is pointed at, and what is said of it. @type {[string, string][]} */
const STEPS = [
  [
    ".viewer-stage",
    "A circle is where an object is, a cross its best keypoint, a diamond that keypoint under one " +
      "map for all frames. Where it tracks the object, the diamond goes with the circle.",
  ],
  [
    ".objects",
    "e is the mean squared distance from diamond to circle. An object is tracked where e is at " +
      "most its threshold μ, the tick on its bar. Try another one.",
  ],
  [
    ".score",
    "TC is the share of tracked objects: on the frames that the maps are fitted on, and on " +
      "sequences that were held out.",
  ],
];

/** @param {Session} session */
export function showGuide(session) {
  const place = byId("guide");
  let isDone = load("guide").done === true;
  let step = -1;

  const point = (/** @type {string} */ at) => {
    for (const element of document.querySelectorAll("[data-guided]"))
      element.removeAttribute("data-guided");
    document.querySelector(at)?.setAttribute("data-guided", "");
  };
  const end = () => {
    isDone = true;
    store("guide", { done: true });
    hide();
  };
  const hide = () => {
    if (step < 0) return;
    step = -1;
    place.hidden = true;
    fill(place);
    point("#guide-nothing");
  };
  const show = (/** @type {number} */ next) => {
    step = next;
    const [at, text] = STEPS[step];
    const isLast = step === STEPS.length - 1;
    const onclick = () => (isLast ? end() : show(step + 1));
    const button = h("button", { type: "button", class: "button", id: "guide-next", onclick });
    button.textContent = isLast ? "Done" : "Next";
    const skip = h("button", { type: "button", class: "link", id: "guide-skip", onclick: end }, "Skip");
    const hadFocus = place.contains(document.activeElement);
    fill(
      place,
      h("p", {}, h("strong", {}, `${step + 1} of ${STEPS.length} `), text),
      h("div", { class: "guide-actions" }, !isLast && skip, button),
    );
    place.hidden = false;
    point(at);
    if (!hadFocus) return;
    button.focus();
    announce(text);
  };
  session.score.addEventListener("scoring", () => {
    const isWanted = !isDone && session.origin !== null && session.score.scoring !== null;
    if (!isWanted) hide();
    else if (step < 0) show(0);
    // The views are made anew with the score.
    else point(STEPS[step][0]);
  });
}
