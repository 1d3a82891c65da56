// @ts-check
/** Data of LeRobot (version 3), in whose videos several episodes lie one after the other. */

import { readVideoEpisodes } from "../../pkg/index.js";
import { count } from "../../ui/format.js";
import { bytesOf, folderOf } from "../sources.js";
import { load } from "./formats.js";
import { openVideo } from "./video.js";

/**
 * @typedef {import("../sources.js").Source} Source
 * @typedef {import("../../pkg/index.js").VideoEpisode} VideoEpisode
 * @typedef {import("../datasets.js").LeRobotVideos} LeRobotVideos
 */

/**
 * The frames of a camera, a sequence an episode.
 * @param {LeRobotVideos} dataset
 * @param {string} [wanted] which camera, instead of the first by name whose videos are there
 * @returns {Promise<{ frames: Source[], cameras: string[], contents: string, problems: string[],
 * close: () => void }>} with the `cameras` whose videos are there
 */
export async function openDataset({ folder, files, episodes: tables }, wanted) {
  /** @type {VideoEpisode[]} */
  const episodes = [];
  for (const table of tables) {
    await load(table.path, "parquet");
    episodes.push(...readVideoEpisodes(await bytesOf(table), table.path));
  }
  const videos = new Map(files.map((file) => [folderOf(file.path), file]));
  const videoOf = (/** @type {VideoEpisode} */ { camera, video }) =>
    videos.get(`${folder}/${camera}/${video}`);
  const cameras = [...new Set(episodes.filter(videoOf).map(({ camera }) => camera))].sort();
  if (cameras.length === 0) {
    throw new Error(
      `none of the videos that the episodes lie in is in ${folder}; expected e.g. ` +
        `${folder}/CAMERA/chunk-000/file-000.mp4`,
    );
  }
  const camera = wanted ?? cameras[0];
  const problems = [];
  const frames = [];
  /** @type {(() => void)[]} */
  const closes = [];
  const codecs = new Set();
  const ofCamera = episodes.filter((episode) => episode.camera === camera);
  for (const video of new Set(ofCamera.map(({ video }) => video))) {
    const itsEpisodes = ofCamera.filter((episode) => episode.video === video);
    const source = videoOf(itsEpisodes[0]);
    if (!source) {
      const missing = count(itsEpisodes.length, "episode");
      problems.push(`${folder}/${camera}/${video} is missing, and with it ${missing}`);
      continue;
    }
    const opened = await openVideo(source);
    closes.push(opened.close);
    codecs.add(opened.codec);
    for (const episode of itsEpisodes) {
      const found = framesOf(episode, opened, `${folder}/${camera}/${episode.sequence}`);
      frames.push(...found);
      if (found.length < episode.frames) {
        problems.push(
          `${episode.sequence} has ${count(episode.frames, "frame")}, ` +
            `but only ${found.length} are in ${source.path}`,
        );
      }
    }
  }
  const total = `${count(ofCamera.length, "episode")}, ${count(frames.length, "frame")}`;
  return {
    frames,
    cameras,
    contents: `${total} of ${camera}, ${[...codecs].join(", ")}`,
    problems,
    close: () => closes.forEach((close) => close()),
  };
}

/**
 * The frames of an episode in its video.
 * @param {VideoEpisode} episode
 * @param {import("./video.js").Video} video
 * @param {string} folder where they are to be
 * @returns {Source[]}
 */
function framesOf({ start, frames: length }, { frames, times }, folder) {
  // Times are rounded; between two frames is far from both.
  const half = times.length > 1 ? (times[times.length - 1] - times[0]) / (times.length - 1) / 2 : 0;
  const first = times.findIndex((time) => time > start - half);
  if (first < 0) return [];
  return frames.slice(first, first + length).map((frame, i) => ({
    ...frame,
    path: `${folder}/frame_${String(i).padStart(6, "0")}`,
  }));
}
