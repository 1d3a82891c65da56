// @ts-check
/** What is seen of frames as they come: the frame with its keypoints, the rate, the recording. */

import { LEAST_MARKED } from "../files/texts.js";
import { openMarking } from "../marking/marking.js";
import { announce, byId, fill, h, notice } from "../ui/dom.js";
import { save } from "../ui/download.js";
import { count, fixed, integer } from "../ui/format.js";
import { keysView, listenToKeys } from "../ui/keys.js";
import { objectColor } from "../ui/palette.js";
import { fit } from "../viewer/fit.js";
import { paint } from "../viewer/scene.js";
import { WHOLE } from "../viewer/view.js";
import { MOST } from "./recording.js";

/** @typedef {import("./live.js").Live} Live */

const KEYS = [
  ["Space", "pause, or go on"],
  ["R", "record, or end the recording"],
];
/** Frames that the trails reach back. */
const TRAIL = 12;
/** Keypoints that are drawn with trails; the others are dots. */
const MOST_TRACKS = 64;
const UNKNOWN = new Float64Array(2 * (TRAIL + 1)).fill(NaN);

export class LiveView {
  #live;
  #place = byId("live");
  #canvas = h("canvas", { id: "live-stage", class: "stage", role: "img", tabIndex: 0 });
  #message = h("div", {});
  #rate = h("p", { id: "live-rate", class: "position" });
  #controls = h("div", { class: "instead-actions" });
  #sources = h("div", { class: "instead-actions" });
  #recorded = h("div", { class: "live-recorded" });
  #file;
  #pause;
  #record;
  /** Keypoints of the last frames, the newest one last. @type {Float64Array[]} */
  #trail = [];
  /** What is told by the elements. */
  #shown = "";

  /** @param {Live} live */
  constructor(live) {
    this.#live = live;
    this.#file = h("input", { id: "live-file", type: "file", accept: "video/*", hidden: true });
    this.#file.addEventListener("change", () => {
      const [file] = this.#file.files ?? [];
      if (file) void live.useFile(file);
      this.#file.value = "";
    });
    const isPaused = () => live.status === "paused";
    const toggle = () => (isPaused() ? void live.resume() : live.pause());
    this.#pause = button("live-pause", "Pause", toggle);
    const record = () => (live.recording ? void live.finish() : live.record());
    this.#record = button("live-record", "Record", record);
    const stop = button("live-stop", "Stop", () => void live.stop());
    fill(this.#controls, this.#pause, this.#record, stop);
    const camera = button("live-camera", "Use the camera", () => void live.useCamera());
    const video = button("live-video", "Play a video file", () => this.#file.click());
    fill(this.#sources, camera, video, this.#file);
    fill(this.#place, this.#stageView(), this.#sideView());
    listenToKeys(this.#place, ({ key }) => {
      const isActive = live.status === "running" || isPaused();
      if (!isActive || (key !== " " && key.toLowerCase() !== "r")) return false;
      if (key === " ") toggle();
      else if (!isPaused() || live.recording) record();
      return true;
    });
  }

  open() {
    this.#place.hidden = false;
    this.update();
    this.#place.firstElementChild?.scrollIntoView({ block: "nearest" });
    /** @type {HTMLElement} */ (this.#sources.firstElementChild)?.focus({ preventScroll: true });
  }

  close() {
    this.#place.hidden = true;
  }

  /** Shows the newest frame. */
  draw() {
    const { frame } = this.#live;
    if (!frame) return;
    this.#trail = [...this.#trail, frame.points].slice(-TRAIL - 1);
    void this.#paint(frame);
    this.#tell();
  }

  update() {
    const { status, message, recorded, recording } = this.#live;
    const isActive = status === "running" || status === "paused";
    if (status === "choosing") this.#trail = [];
    this.#place.dataset.status = status;
    this.#canvas.hidden = !isActive;
    this.#controls.hidden = !isActive;
    this.#sources.hidden = isActive;
    this.#pause.textContent = status === "paused" ? "Go on" : "Pause";
    this.#record.textContent = recording ? "End the recording" : "Record";
    this.#record.setAttribute("aria-pressed", String(recording !== null));
    /** @type {HTMLButtonElement} */ (this.#record).disabled = status !== "running" && !recording;
    const { truth, marked } = this.#live.session;
    const canMark = truth === null || marked !== null;
    const shown = `${status} ${message} ${recorded?.folder} ${recorded?.length} ${canMark}`;
    if (shown !== this.#shown) {
      this.#shown = shown;
      const kind = status === "paused" ? "info" : "error";
      fill(this.#message, message !== "" && notice(kind, message));
      fill(this.#recorded, ...(recorded ? this.#recordedView(recorded, canMark) : []));
    }
    this.#tell();
  }

  #stageView() {
    const head = h(
      "div",
      { class: "viewer-head" },
      h("h2", { id: "live-title" }, "Live"),
      this.#rate,
    );
    const keys = h("details", { class: "keys" }, h("summary", {}, "Keys"), keysView(KEYS));
    return h(
      "div",
      { class: "panel viewer-stage" },
      ...[head, this.#message, this.#sources, this.#canvas, this.#controls, keys],
    );
  }

  #sideView() {
    const text =
      "Whenever the encoder is free, it takes the newest frame; those that come meanwhile are left " +
      "out. Nothing is kept or sent unless you record, and then only in this page.";
    const close = button("live-close", "Close", () => {
      void this.#live.close();
      announce("The camera or video was closed.");
      byId("files-title").focus({ preventScroll: true });
    });
    return h(
      "div",
      { class: "panel instead-side" },
      h("p", { class: "viewer-note" }, text),
      this.#recorded,
      close,
    );
  }

  /**
   * What can be done with a recording.
   * @param {import("./recording.js").Recording} recorded
   * @param {boolean} canMark whether there is no table
   */
  #recordedView(recorded, canMark) {
    const { session } = this.#live;
    const rate = recorded.seconds > 0 ? (recorded.length - 1) / recorded.seconds : 0;
    const text =
      `Recorded ${count(recorded.length, "frame")} in ${fixed(recorded.seconds, 1)} s ` +
      `(${fixed(rate, 1)} frames/s) as the sequence ${recorded.folder}. A score takes a table of ` +
      `positions, or objects marked by hand in at least ${LEAST_MARKED} frames; those between them are ` +
      "not scored.";
    const mark = button("live-mark", "Mark objects in it", async () => {
      await this.#live.close();
      await openMarking(session);
    });
    const take = button("live-save", "Save its frames (ZIP)", async () => {
      const { zipOf } = await import("../files/containers/zip-writer.js");
      const archive = await zipOf(await recorded.files());
      save(`${recorded.folder}.zip`, "application/zip", archive);
    });
    return [
      h("p", { role: "status" }, text),
      h("div", { class: "instead-actions" }, canMark && mark, take),
    ];
  }

  /** Says how fast it is. */
  #tell() {
    const { status, rate, recording, frame, sourceName } = this.#live;
    const parts = [
      status === "starting" && "Starting …",
      status === "paused" && "Paused",
      status === "running" && (rate > 0 ? `${fixed(rate, 1)} frames/s` : "First frame …"),
      recording && `recording ${integer(recording.length)} of at most ${integer(MOST.frames)}`,
    ];
    const text = parts.filter(Boolean).join(" · ");
    if (this.#rate.textContent !== text) this.#rate.textContent = text;
    Object.assign(this.#place.dataset, {
      rate: fixed(rate, 2),
      recorded: String(recording?.length ?? 0),
      keypoints: String((frame?.points.length ?? 0) / 2),
    });
    this.#canvas.setAttribute("aria-label", `Newest frame of ${sourceName} with its keypoints`);
  }

  /** @param {import("./live.js").LiveFrame} frame */
  async #paint({ image, points }) {
    const bitmap = await createImageBitmap(image);
    const context = fit(this.#canvas, image);
    if (context) {
      paint(context, window.devicePixelRatio, {
        image: bitmap,
        caption: "",
        view: WHOLE,
        tracks: this.#tracks(),
        ...{ start: 0, frame: this.#trail.length - 1, hovered: null, heat: null },
        layers: new Set(["keypoint", "keypoints", "trails"]),
        keypoints: points.subarray(2 * MOST_TRACKS),
      });
      this.#canvas.dataset.frames = String(Number(this.#canvas.dataset.frames ?? 0) + 1);
    }
    bitmap.close();
  }

  /** The first keypoints with where they came from. @returns {import("../viewer/scene.js").Track[]} */
  #tracks() {
    const [{ length }] = this.#trail;
    return Array.from({ length: Math.min(length / 2, MOST_TRACKS) }, (_, n) => {
      const keypoint = Float64Array.from(
        this.#trail.flatMap((all) => [all[2 * n], all[2 * n + 1]]),
      );
      const series = { truth: UNKNOWN, keypoint, transformed: UNKNOWN, distances: UNKNOWN };
      return { series, keypoint: null, color: objectColor(n), isSelected: false };
    });
  }
}

/**
 * @param {string} id
 * @param {string} label
 * @param {() => void} onclick
 */
function button(id, label, onclick) {
  return h("button", { id, type: "button", class: "button", onclick }, label);
}
