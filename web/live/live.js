// @ts-check
/**
 * Keypoints of frames as they come: the newest frame goes to the encoder whenever that is free.
 * Fetched when somebody asks for it.
 */

import { messageOf } from "../errors.js";
import { arrayOfPixels } from "../files/containers/npy.js";
import { latentToImage } from "../pkg/index.js";
import { opener } from "../ui/instead.js";
import { Recording } from "./recording.js";
import { openCamera, openFile } from "./source.js";
import { LiveView } from "./view.js";

/**
 * @typedef {import("../session.js").Session} Session
 * @typedef {import("../extraction/extractor.js").Extracted} Extracted
 * @typedef {import("../extraction/extractor.js").OpenEncoder} OpenEncoder
 * @typedef {import("./source.js").LiveSource} LiveSource
 *
 * A frame with what was extracted of it, and its keypoints in ndc.
 * @typedef {{ image: ImageData, extracted: Extracted, points: Float64Array }} LiveFrame
 */

/** Milliseconds that the rate is taken over. */
const RATE_OVER = 2000;

/** Opens the live view, or goes back to it. */
export const openLive = opener(
  new URL("./live.css", import.meta.url),
  (/** @type {Session} */ session) => new Live(session),
);

export class Live {
  /** @type {"choosing" | "starting" | "running" | "paused"} */
  status = "choosing";
  /** What went wrong, or ended. */
  message = "";
  /** @type {LiveFrame | null} */
  frame = null;
  /** Frames that were recorded and are not saved yet. @type {Recording | null} */
  recording = null;
  /** What was recorded last. @type {Recording | null} */
  recorded = null;

  session;
  #view;
  #isOpen = false;
  /** @type {LiveSource | null} */
  #source = null;
  /** @type {OpenEncoder | null} */
  #encoder = null;
  /** Tells what is under way that it is not wanted any more. */
  #ticket = 0;
  /** The frame that is with the encoder, which has one at a time. @type {Promise<unknown>} */
  #last = Promise.resolve();
  /** When the last frames were done. @type {number[]} */
  #done = [];

  /** @param {Session} session */
  constructor(session) {
    this.session = session;
    this.#view = new LiveView(this);
    session.addEventListener("files", () => this.#follow());
    session.addEventListener("extraction", () => {
      const isBusy = session.extraction?.status === "running";
      if (isBusy && this.status === "running") this.#hold("Paused while frames are extracted.");
    });
  }

  open() {
    this.#isOpen = true;
    this.#follow();
    this.#view.open();
  }

  /** Gives the camera back and closes the view. */
  async close() {
    await this.finish();
    this.#stop("");
    this.#isOpen = false;
    this.#view.close();
  }

  /** Frames a second, over the last ones. */
  get rate() {
    const [first] = this.#done;
    const last = this.#done[this.#done.length - 1];
    return last > first ? ((this.#done.length - 1) * 1000) / (last - first) : 0;
  }

  get sourceName() {
    return this.#source?.name ?? "";
  }

  useCamera() {
    return this.#use(openCamera);
  }

  /** @param {File} file */
  useFile(file) {
    return this.#use(() => openFile(file));
  }

  pause() {
    this.#hold("");
  }

  async resume() {
    if (this.status !== "paused" || !this.#source) return;
    try {
      await this.#source.play();
    } catch (error) {
      this.#stop(messageOf(error));
      return;
    }
    void this.#run(this.#source);
  }

  /** Ends the camera or the video. */
  async stop() {
    await this.finish();
    this.#stop("");
  }

  record() {
    let number = 1;
    const isTaken = (/** @type {string} */ folder) =>
      this.session.frameSources.some(({ path }) => path.startsWith(`${folder}/`));
    while (isTaken(`live_${number}`)) number++;
    this.recording = new Recording(`live_${number}`);
    this.recorded = null;
    this.#view.update();
  }

  /** Ends the recording; its frames become frames of the session. */
  async finish() {
    const { recording } = this;
    this.recording = null;
    if (!recording || recording.length === 0) return;
    this.recorded = recording;
    this.#view.update();
    const encoder = /** @type {OpenEncoder} */ (this.#encoder);
    await this.session.addRecorded(await recording.files(), encoder);
  }

  // What follows

  /** @param {() => Promise<LiveSource>} open */
  async #use(open) {
    this.#stop("");
    this.status = "starting";
    this.#view.update();
    const mine = this.#ticket;
    try {
      const source = await open();
      if (mine !== this.#ticket) {
        source.close();
        return;
      }
      this.#source = source;
      source.onEnd = (why) => void this.finish().then(() => this.#hold(why));
      void this.#run(source);
    } catch (error) {
      if (mine === this.#ticket) this.#stop(messageOf(error));
    }
  }

  /** @param {LiveSource} source */
  async #run(source) {
    this.status = "running";
    this.message = "";
    this.#done = [];
    this.#view.update();
    const mine = ++this.#ticket;
    const isWanted = () => mine === this.#ticket;
    try {
      await this.#last;
      for (;;) {
        const image = await source.next(isWanted);
        if (!image) return;
        const extracting = this.#extract(image);
        this.#last = extracting.catch(() => {});
        const extracted = await extracting;
        if (!isWanted()) return;
        this.#take({ image, extracted, points: this.#placed(extracted, image) });
      }
    } catch (error) {
      if (isWanted()) this.#stop(messageOf(error));
    }
  }

  /** @param {LiveFrame} frame */
  #take(frame) {
    this.frame = frame;
    this.recording?.add(frame.image, frame.extracted);
    const now = performance.now();
    this.#done.push(now);
    while (now - this.#done[0] > RATE_OVER) this.#done.shift();
    this.#view.draw();
    if (this.recording?.isFull) void this.finish();
  }

  /**
   * @param {ImageData} image
   * @returns {Promise<Extracted>}
   */
  #extract(image) {
    const encoder = /** @type {OpenEncoder} */ (this.#encoder);
    return new Promise((resolve, reject) => {
      const job = {
        frames: [{ path: "the frame", blob: arrayOfPixels(image) }],
        signal: new AbortController().signal,
        onFrame: (/** @type {string} */ _, /** @type {Extracted} */ found) => resolve(found),
        onFailure: (/** @type {string} */ _, /** @type {string} */ why) => reject(new Error(why)),
      };
      encoder.extract(job).catch(reject);
    });
  }

  /**
   * @param {Extracted} extracted
   * @param {ImageData} image
   */
  #placed({ points }, { width, height }) {
    const config = this.#encoder?.info.config ?? null;
    return config === null ? points : latentToImage(config, points, width, height);
  }

  /** @param {string} why it is paused; empty: as the user asked */
  #hold(why) {
    if (this.status !== "running") return;
    this.#source?.pause();
    this.status = "paused";
    this.message = why;
    this.#ticket++;
    this.#view.update();
  }

  /** @param {string} message */
  #stop(message) {
    this.#ticket++;
    this.#source?.close();
    this.#source = null;
    this.status = "choosing";
    this.message = message;
    this.frame = null;
    this.#view.update();
  }

  /** Follows the checkpoint in use. */
  #follow() {
    if (!this.#isOpen) return;
    const { encoder } = this.session;
    if (!encoder) {
      this.#stop("");
      this.#isOpen = false;
      this.#view.close();
      return;
    }
    if (this.#encoder && this.#encoder !== encoder) this.#stop("Another checkpoint is in use now.");
    this.#encoder = encoder;
    this.#view.update();
  }
}
