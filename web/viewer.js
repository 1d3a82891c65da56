// @ts-check
/** The frames of a sequence with the object, its best keypoint and the keypoint under the fitted map. */

import { byId, fill, h, icon } from "./dom.js";
import { baseName, count, integer } from "./format.js";
import { ImageCache } from "./image-cache.js";
import { plots } from "./plots.js";
import { paint } from "./scene.js";

/** @typedef {import("./session.js").Session} Session */

const SPEEDS = [2, 5, 10, 25];
/** Frames decoded ahead of the one on display while playing. */
const AHEAD = 4;

/** @param {Session} session */
export function showViewer(session) {
  const place = byId("viewer");
  const cache = new ImageCache();

  const canvas = h("canvas", { id: "stage", class: "stage", role: "img", tabIndex: 0 });
  const objects = h("select", {
    id: "viewer-object",
    onchange: () => session.select({ object: objects.selectedIndex }),
  });
  const sequences = h("select", {
    id: "viewer-sequence",
    onchange: () => session.select({ frame: session.sequences[sequences.selectedIndex].start }),
  });
  const scrubber = h("input", {
    id: "scrubber",
    type: "range",
    min: "0",
    step: "1",
    "aria-label": "Frame",
    oninput: () => goTo(scrubber.valueAsNumber),
  });
  const speed = h(
    "select",
    { id: "speed" },
    ...SPEEDS.map((fps) => h("option", { value: String(fps), selected: fps === 5 }, `${fps} frames/s`)),
  );
  const play = h("button", { id: "play", type: "button", class: "button round", onclick: () => setPlaying(!playing) });
  const position = h("output", { id: "position", class: "position", for: "scrubber" });
  const legend = h("ul", { class: "legend" });
  const note = h("p", { class: "viewer-note" });

  fill(
    place,
    h(
      "div",
      { class: "viewer-head" },
      h("h2", { id: "viewer-title" }, "Frames and trajectories"),
      h("label", { class: "field" }, h("span", {}, "Object"), objects),
      h("label", { class: "field" }, h("span", {}, "Sequence"), sequences),
    ),
    h(
      "div",
      { class: "viewer-body" },
      h(
        "div",
        { class: "viewer-stage" },
        canvas,
        h(
          "div",
          { class: "transport" },
          play,
          scrubber,
          position,
          h("label", { class: "field" }, h("span", { class: "visually-hidden" }, "Speed"), speed),
        ),
        legend,
        note,
      ),
      h("div", { class: "viewer-plots" }, ...plots(session)),
    ),
  );

  // The frame on display

  let drawing = 0;
  const draw = async () => {
    const { frame } = session.selection;
    const ticket = ++drawing;
    const source = session.picture(frame);
    let image = source ? cache.peek(source) : null;
    if (source && image === undefined) {
      image = await cache.load(source);
      // Another frame was asked for meanwhile, or other files came.
      if (ticket !== drawing) return;
    }
    if (!session.evaluation) return;
    const sequence = session.sequenceOf(frame);
    const size = image ? { width: image.width, height: image.height } : sizeOfPlate(session);
    canvas.style.aspectRatio = `${size.width} / ${size.height}`;
    canvas.style.maxWidth = `calc(75vh * ${size.width / size.height})`;
    const scale = window.devicePixelRatio;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.round(side * scale));
    if (width === 0 || height === 0) return;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const context = canvas.getContext("2d");
    if (!context) return;
    const missing = source ? `${baseName(source.path)} cannot be shown by this browser` : "no image of this frame";
    paint(context, scale, {
      image: image ?? null,
      caption: image || !session.hasPictures ? "" : missing,
      series: session.series(session.selection.object),
      start: sequence?.start ?? frame,
      frame,
    });
    canvas.dataset.picture = image ? (source?.path ?? "") : "none";
    canvas.dataset.frame = String(frame);
    canvas.setAttribute("aria-label", describe(session));
  };

  /** @param {number} index in the sequence on display */
  const goTo = (index) => {
    const sequence = session.sequenceOf(session.selection.frame);
    if (sequence) session.select({ frame: sequence.start + Math.min(Math.max(index, 0), sequence.length - 1) });
  };
  const index = () => session.selection.frame - (session.sequenceOf(session.selection.frame)?.start ?? 0);

  // Playing

  let playing = false;
  let due = 0;
  /** @param {boolean} next */
  const setPlaying = (next) => {
    playing = next && session.evaluation !== null;
    fill(play, icon(playing ? "icon-pause" : "icon-play"));
    play.setAttribute("aria-label", playing ? "Pause" : "Play");
    play.title = playing ? "Pause (space)" : "Play (space)";
    if (playing) {
      due = performance.now();
      requestAnimationFrame(tick);
    }
  };
  /** @param {number} now */
  const tick = (now) => {
    const sequence = session.sequenceOf(session.selection.frame);
    if (!playing || !sequence) return;
    if (now >= due) {
      const interval = 1000 / Number(speed.value);
      // After a hitch the pace is kept, what was missed is not made up for.
      due = Math.max(due + interval, now);
      goTo((index() + 1) % sequence.length);
      for (let ahead = 1; ahead <= Math.min(AHEAD, sequence.length - 1); ahead++) {
        const source = session.picture(sequence.start + ((index() + ahead) % sequence.length));
        if (source) void cache.load(source);
      }
    }
    requestAnimationFrame(tick);
  };
  setPlaying(false);

  place.addEventListener("keydown", (event) => {
    const { target, key } = event;
    if (target instanceof HTMLSelectElement || event.ctrlKey || event.altKey || event.metaKey) return;
    if (key === " ") {
      if (target instanceof HTMLButtonElement) return;
      setPlaying(!playing);
    } else if (target === scrubber) {
      return;
    } else if (key === "ArrowRight") goTo(index() + 1);
    else if (key === "ArrowLeft") goTo(index() - 1);
    else if (key === "Home") goTo(0);
    else if (key === "End") goTo(Infinity);
    else return;
    event.preventDefault();
  });
  canvas.addEventListener("pointerdown", () => canvas.focus());

  // Following the session

  const showSelection = () => {
    place.hidden = session.evaluation === null;
    const { object, frame } = session.selection;
    const sequence = session.sequenceOf(frame);
    if (!session.evaluation || !sequence) return;
    objects.selectedIndex = object;
    sequences.selectedIndex = session.sequences.indexOf(sequence);
    scrubber.max = String(sequence.length - 1);
    scrubber.value = String(index());
    const number = session.frameNumbers[frame];
    position.textContent = `frame ${integer(number)}`;
    position.title = `${integer(index() + 1)} of ${count(sequence.length, "frame")}`;
    scrubber.setAttribute("aria-valuetext", `frame ${number}, ${index() + 1} of ${sequence.length}`);
    void draw();
  };
  const showLegend = () => {
    const result = session.evaluation?.objects[session.selection.object];
    if (!result) return;
    const keypoint = session.keypointOf(session.selection.object);
    const item = (/** @type {string} */ mark, /** @type {string} */ label) =>
      h("li", { data: { mark } }, icon(`mark-${mark}`, "mark"), label);
    fill(
      legend,
      item("truth", `${result.name}, ground truth`),
      keypoint !== null && item("keypoint", `keypoint ${keypoint}`),
      keypoint !== null && item("transformed", `keypoint ${keypoint} under the fitted map`),
    );
    note.textContent =
      keypoint === null
        ? "This object is visible in no frame, so no keypoint is fitted to it."
        : session.placesKeypoints
          ? "The keypoint itself is drawn where the grid of the encoder places it in the image."
          : "The keypoint itself is drawn as given, taken as image coordinates (ndc).";
  };

  session.addEventListener("scoring", () => {
    setPlaying(false);
    cache.clear();
    drawing++;
    fill(objects, ...session.objects.map((name) => h("option", {}, name)));
    fill(sequences, ...session.sequences.map(({ name }) => h("option", {}, name)));
    showSelection();
    showLegend();
  });
  session.addEventListener("evaluation", () => {
    void draw();
    showLegend();
  });
  session.addEventListener("selection", () => {
    showSelection();
    showLegend();
  });
  new ResizeObserver(() => void draw()).observe(canvas);
  window.addEventListener("resize", () => void draw());
}

/** @param {Session} session */
function sizeOfPlate(session) {
  const [width, height] = session.imageSize ?? [1, 1];
  return { width, height };
}

/** @param {Session} session */
function describe(session) {
  const { object, frame } = session.selection;
  const series = session.series(object);
  const where = `Frame ${session.frameNumbers[frame]} of sequence ${session.sequenceOf(frame)?.name}`;
  if (!series) return where;
  const point = (/** @type {Float64Array} */ points) => {
    const [x, y] = points.subarray(2 * frame, 2 * frame + 2);
    return Number.isNaN(x) ? "not visible" : `at x ${x.toFixed(2)}, y ${y.toFixed(2)}`;
  };
  return `${where}: ${session.objects[object]} ${point(series.truth)}, keypoint ${point(series.keypoint)}, transformed ${point(series.transformed)}`;
}
