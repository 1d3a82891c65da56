// @ts-check
/** The controls of the player: buttons, scrubber, speed. */

import { fill, h, icon } from "../ui/dom.js";
import { count, integer } from "../ui/format.js";
import { Player } from "./player.js";

/** @typedef {import("../session.js").Session} Session */

/** Frames per second. */
const SPEED = { least: 0.1, most: 240, suggested: [1, 2, 5, 10, 25, 50, 100] };

/**
 * @param {Session} session
 * @param {(frame: number) => void} prepare decodes a frame that is shown soon
 * @param {{ speed: number }} look
 * @param {() => void} onSpeed
 */
export function transport(session, prepare, look, onSpeed) {
  const play = h("button", {
    id: "play",
    type: "button",
    class: "button round",
    onclick: () => player.toggle(),
  });
  const label = (/** @type {boolean} */ isPlaying) => {
    fill(play, icon(isPlaying ? "icon-pause" : "icon-play"));
    play.setAttribute("aria-label", isPlaying ? "Pause" : "Play");
    play.title = isPlaying ? "Pause (space)" : "Play (space)";
  };
  const player = new Player(session, prepare, look, label);
  const scrubber = h("input", {
    id: "scrubber",
    type: "range",
    min: "0",
    step: "1",
    "aria-label": "Frame",
    oninput: () => player.moveTo(scrubber.valueAsNumber),
  });
  const position = h("output", { id: "position", class: "position", for: "scrubber" });
  const buttons = [
    stepButton("icon-back", "Frame before (←)", () => player.step(-1)),
    play,
    stepButton("icon-forward", "Next frame (→)", () => player.step(1)),
  ];
  const element = h(
    "div",
    { class: "transport" },
    h("div", { class: "transport-buttons" }, ...buttons),
    scrubber,
    position,
  );
  label(false);

  const update = () => {
    player.follow();
    const range = player.sequence;
    if (!range) return;
    const number = session.score.frameNumbers[session.score.selection.frame];
    scrubber.max = String(range.length - 1);
    scrubber.value = String(player.index);
    position.textContent = `frame ${integer(number)}`;
    position.title = `${integer(player.index + 1)} of ${count(range.length, "frame")}`;
    const text = `frame ${number}, ${player.index + 1} of ${range.length}`;
    scrubber.setAttribute("aria-valuetext", text);
  };
  return { element, speedField: speedField(look, onSpeed), player, update };
}

/**
 * @param {string} symbol
 * @param {string} label
 * @param {() => void} onclick
 */
function stepButton(symbol, label, onclick) {
  const names = { "aria-label": label, title: label };
  return h("button", { type: "button", class: "button round", ...names, onclick }, icon(symbol));
}

/**
 * @param {{ speed: number }} look
 * @param {() => void} onSpeed
 */
function speedField(look, onSpeed) {
  const speed = h("input", {
    id: "speed",
    type: "number",
    min: String(SPEED.least),
    max: String(SPEED.most),
    step: "any",
    value: String(look.speed),
    "aria-label": "Frames per second",
    oninput: () => {
      const value = speed.valueAsNumber;
      const isValid = value >= SPEED.least && value <= SPEED.most;
      speed.setAttribute("aria-invalid", String(!isValid));
      if (!isValid) return;
      look.speed = value;
      onSpeed();
    },
    onblur: () => {
      speed.value = String(look.speed);
      speed.setAttribute("aria-invalid", "false");
    },
  });
  speed.setAttribute("list", "speeds");
  const options = SPEED.suggested.map((fps) => h("option", { value: String(fps) }));
  const suggestions = h("datalist", { id: "speeds" }, ...options);
  const unit = h("span", { "aria-hidden": "true" }, "frames/s");
  return h("label", { class: "field" }, speed, suggestions, unit);
}
