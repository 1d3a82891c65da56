// What scores: the part `scoring`, or `space`, which takes its place once it is loaded. Its exports are
// live, so that whoever imported them has those of the part in use.
import * as plane from "./tracklens_scoring.js";

export let {
  Arrays,
  Bootstrap,
  Camera,
  FrameIndex,
  GroundTruthTable,
  KeypointTable,
  Scoring,
  classify,
  findRuns,
  joinFrames,
  latentToImage,
  readArchive,
  version,
} = plane;

/** Loads the part that also scores points in space, and puts it in the place of the other one. */
export async function loadSpace(options) {
  const space = await import("./tracklens_space.js");
  await space.default(options);
  ({
    Arrays,
    Bootstrap,
    Camera,
    FrameIndex,
    GroundTruthTable,
    KeypointTable,
    Scoring,
    classify,
    findRuns,
    joinFrames,
    latentToImage,
    readArchive,
    version,
  } = space);
}
