// @ts-check
/** Frames as they come: of a camera, or of a video that plays. */

import { messageOf } from "../errors.js";

/** What is asked of a camera; it may give something else. */
const WANTED = {
  width: { ideal: 640 },
  height: { ideal: 480 },
  facingMode: { ideal: "environment" },
};

const FILE = "play a video file instead";

/** Why a camera cannot be used, by the name of the error. @type {Record<string, string>} */
const REASONS = {
  NotFoundError: `No camera was found. Plug one in and try again, or ${FILE}.`,
  NotAllowedError:
    "The camera may not be used. Allow it for this page, by the symbol beside the address or in " +
    `the settings of the system, and try again, or ${FILE}.`,
  NotReadableError:
    "The camera does not start: another program may be using it. Close that one and try again, or " +
    `${FILE}.`,
};
REASONS.AbortError = REASONS.NotReadableError;
REASONS.SecurityError = REASONS.NotAllowedError;

const AROUND = ' The page around this one has to allow it, too (`allow="camera"` of its frame).';

/** A video on display nowhere, whose newest frame is asked for. */
export class LiveSource {
  /** What it is, in words. */
  name;
  /** Called when it ends without being asked to. @type {(why: string) => void} */
  onEnd = () => {};

  #video;
  #close;
  /** Whether there is a frame that was not given yet. */
  #isFresh = false;
  #canvas = new OffscreenCanvas(1, 1);

  /**
   * @param {string} name
   * @param {HTMLVideoElement} video
   * @param {() => void} close
   */
  constructor(name, video, close) {
    this.name = name;
    this.#video = video;
    this.#close = close;
    video.addEventListener("ended", () => this.onEnd("The video is at its end."));
    this.#watch();
  }

  /** Goes on after a pause, and from the start after the end. */
  async play() {
    await this.#video.play();
  }

  pause() {
    this.#video.pause();
  }

  /** Gives the camera or the file back. */
  close() {
    this.#video.pause();
    this.#close();
  }

  /**
   * The newest frame, once there is one that was not given yet; `null` when it is not wanted any
   * more.
   * @param {() => boolean} isWanted
   * @returns {Promise<ImageData | null>}
   */
  async next(isWanted) {
    while (!this.#isFresh) {
      await new Promise((done) => requestAnimationFrame(done));
      if (!isWanted()) return null;
    }
    this.#isFresh = false;
    const { videoWidth: width, videoHeight: height } = this.#video;
    const canvas = this.#canvas;
    if (canvas.width !== width || canvas.height !== height)
      Object.assign(canvas, { width, height });
    const settings = { willReadFrequently: true, alpha: false };
    const context = /** @type {OffscreenCanvasRenderingContext2D} */ (
      canvas.getContext("2d", settings)
    );
    context.drawImage(this.#video, 0, 0, width, height);
    return context.getImageData(0, 0, width, height);
  }

  /** Notices new frames. */
  #watch() {
    const video = this.#video;
    const tells = typeof video.requestVideoFrameCallback === "function";
    if (tells) {
      const seen = () => {
        this.#isFresh = true;
        video.requestVideoFrameCallback(seen);
      };
      video.requestVideoFrameCallback(seen);
      return;
    }
    // Browsers that do not tell of frames tell the time, more rarely.
    video.addEventListener("timeupdate", () => (this.#isFresh = true));
  }
}

/** @returns {Promise<LiveSource>} */
export async function openCamera() {
  if (!navigator.mediaDevices?.getUserMedia) {
    throw new Error(
      "This browser gives the page no camera; expected the page from https:// or localhost. Open " +
        `it from there, or ${FILE}.`,
    );
  }
  const stream = await navigator.mediaDevices
    .getUserMedia({ video: WANTED, audio: false })
    .catch((error) => {
      throw new Error(cameraError(error));
    });
  const video = silent();
  video.srcObject = stream;
  const [track] = stream.getVideoTracks();
  const source = new LiveSource(track.label || "camera", video, () => track.stop());
  track.addEventListener("ended", () =>
    source.onEnd("The camera stopped: it was unplugged, or may not be used any more."),
  );
  await source.play();
  return source;
}

/**
 * @param {File} file
 * @returns {Promise<LiveSource>}
 */
export async function openFile(file) {
  const video = silent();
  const url = URL.createObjectURL(file);
  video.src = url;
  const source = new LiveSource(file.name, video, () => {
    video.removeAttribute("src");
    URL.revokeObjectURL(url);
  });
  try {
    await source.play();
    return source;
  } catch (error) {
    source.close();
    throw new Error(
      `${file.name} cannot be played by this browser (${messageOf(video.error ?? error)}). ` +
        "Expected MP4 or WebM; convert it, e.g. ffmpeg -i VIDEO -c:v libvpx-vp9 -crf 20 VIDEO.webm",
    );
  }
}

/** @param {unknown} error of `getUserMedia` */
function cameraError(error) {
  const name = error instanceof DOMException ? error.name : "";
  const reason = REASONS[name] ?? `The camera cannot be used (${messageOf(error)}); ${FILE}.`;
  const isInside = window.parent !== window && reason === REASONS.NotAllowedError;
  return isInside ? reason + AROUND : reason;
}

function silent() {
  const video = document.createElement("video");
  return Object.assign(video, { muted: true, playsInline: true });
}
