// What all parts of the package export.
export { needsDecoding, needsFormats, needsParquet } from "./parts.js";
export {
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
} from "./scoring.js";
export * from "./tracklens_doctor.js";
export * from "./tracklens_extraction.js";
export * from "./tracklens_images.js";
export * from "./tracklens_formats.js";
export * from "./tracklens_parquet.js";
export * from "./tracklens_zarr.js";
export * from "./tracklens_onnx.js";
export * from "./tracklens_temporal.js";
export * from "./tracklens_figures.js";
export * from "./tracklens_comparison.js";
