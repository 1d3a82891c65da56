// @ts-check
/** Moving through the frames of a sequence: scrubber, playing, steps. */

import { fill, h, icon } from "../ui/dom.js";
import { count, integer } from "../ui/format.js";

/** @typedef {import("../session.js").Session} Session */

/** Frames a second. */
const SPEED = { usual: 5, least: 0.1, most: 240, suggested: [1, 2, 5, 10, 25, 50, 100] };
/** Frames decoded ahead of the one on display while playing or moving. */
const AHEAD = 4;
/** Frames that a key moves with the shift key. */
const FAR = 10;

/**
 * @param {Session} session
 * @param {(frame: number) => void} prepare decodes a frame that is shown soon
 * @param {{ speed: number }} settings
 * @param {() => void} onSetting
 */
export function transport(session, prepare, settings, onSetting) {
  const sequence = () => session.score.sequenceOf(session.score.selection.frame);
  const index = () => session.score.selection.frame - (sequence()?.start ?? 0);
  /** @param {number} to in the sequence on display */
  const goTo = (to) => {
    const range = sequence();
    if (range)
      session.score.select({ frame: range.start + Math.min(Math.max(to, 0), range.length - 1) });
  };
  /**
   * Goes to a frame that the user asks for; those that come next if the movement goes on are
   * decoded meanwhile.
   * @param {number} to in the sequence on display
   */
  const moveTo = (to) => {
    const before = index();
    goTo(to);
    const range = sequence();
    const step = index() - before;
    // After a jump nobody knows where the next one leads.
    if (!range || step === 0 || Math.abs(step) > FAR) return;
    for (let ahead = 1; ahead <= AHEAD; ahead++) {
      const next = index() + ahead * step;
      if (next >= 0 && next < range.length) prepare(range.start + next);
    }
  };
  /** @param {number} by sequences */
  const goToSequence = (by) => {
    const range = sequence();
    const at = range ? session.score.sequences.indexOf(range) : 0;
    const next =
      session.score.sequences[Math.min(Math.max(at + by, 0), session.score.sequences.length - 1)];
    if (next && next !== range) session.score.select({ frame: next.start });
  };

  const scrubber = h("input", {
    id: "scrubber",
    type: "range",
    min: "0",
    step: "1",
    "aria-label": "Frame",
    oninput: () => moveTo(scrubber.valueAsNumber),
  });
  const position = h("output", { id: "position", class: "position", for: "scrubber" });
  const speed = h("input", {
    id: "speed",
    type: "number",
    min: String(SPEED.least),
    max: String(SPEED.most),
    step: "any",
    value: String(settings.speed),
    "aria-label": "Frames a second",
    oninput: () => {
      const valid = speed.valueAsNumber >= SPEED.least && speed.valueAsNumber <= SPEED.most;
      speed.setAttribute("aria-invalid", String(!valid));
      if (!valid) return;
      settings.speed = speed.valueAsNumber;
      onSetting();
    },
    onblur: () => {
      speed.value = String(settings.speed);
      speed.setAttribute("aria-invalid", "false");
    },
  });
  speed.setAttribute("list", "speeds");
  const speeds = h(
    "datalist",
    { id: "speeds" },
    ...SPEED.suggested.map((fps) => h("option", { value: String(fps) })),
  );
  const play = h("button", {
    id: "play",
    type: "button",
    class: "button round",
    onclick: () => setPlaying(!playing),
  });
  const stepButton = (
    /** @type {string} */ symbol,
    /** @type {string} */ label,
    /** @type {number} */ by,
  ) =>
    h(
      "button",
      {
        type: "button",
        class: "button round",
        "aria-label": label,
        title: label,
        onclick: () => moveTo(index() + by),
      },
      icon(symbol),
    );
  const element = h(
    "div",
    { class: "transport" },
    h(
      "div",
      { class: "transport-buttons" },
      stepButton("icon-back", "Frame before (←)", -1),
      play,
      stepButton("icon-forward", "Next frame (→)", 1),
    ),
    scrubber,
    position,
  );
  const speedField = h(
    "label",
    { class: "field" },
    speed,
    speeds,
    h("span", { "aria-hidden": "true" }, "frames/s"),
  );

  let playing = false;
  let due = 0;
  /** @param {boolean} next */
  const setPlaying = (next) => {
    playing = next && session.score.scoring !== null;
    fill(play, icon(playing ? "icon-pause" : "icon-play"));
    play.setAttribute("aria-label", playing ? "Pause" : "Play");
    play.title = playing ? "Pause (space)" : "Play (space)";
    if (!playing) return;
    due = performance.now();
    requestAnimationFrame(tick);
  };
  /** @param {number} now */
  const tick = (now) => {
    const range = sequence();
    if (!playing || !range) return;
    if (now >= due) {
      const interval = 1000 / settings.speed;
      // Faster than the display some frames are left out; after a longer hitch what was missed is
      // not made up for.
      const steps = Math.min(
        1 + Math.floor((now - due) / interval),
        Math.max(1, Math.ceil(settings.speed / 10)),
      );
      due = Math.max(due + steps * interval, now);
      goTo((index() + steps) % range.length);
      for (let ahead = 1; ahead <= Math.min(AHEAD, range.length - 1); ahead++) {
        prepare(range.start + ((index() + ahead * steps) % range.length));
      }
    }
    requestAnimationFrame(tick);
  };
  setPlaying(false);

  /**
   * Whether the key was one of these.
   * @param {KeyboardEvent} event
   */
  const key = ({ key, shiftKey }) => {
    const step = shiftKey ? FAR : 1;
    if (key === " ") setPlaying(!playing);
    else if (key === "ArrowRight") moveTo(index() + step);
    else if (key === "ArrowLeft") moveTo(index() - step);
    else if (key === "Home") goTo(0);
    else if (key === "End") goTo(Infinity);
    else if (key === "PageUp") goToSequence(-1);
    else if (key === "PageDown") goToSequence(1);
    else return false;
    return true;
  };

  const update = () => {
    const { frame } = session.score.selection;
    const range = sequence();
    if (!range) return;
    scrubber.max = String(range.length - 1);
    scrubber.value = String(index());
    const number = session.score.frameNumbers[frame];
    position.textContent = `frame ${integer(number)}`;
    position.title = `${integer(index() + 1)} of ${count(range.length, "frame")}`;
    scrubber.setAttribute("aria-valuetext", `frame ${number}, ${index() + 1} of ${range.length}`);
  };
  return { element, speedField, key, update, pause: () => setPlaying(false) };
}
