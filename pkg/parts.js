// The parts of the package, each a WebAssembly file of its own that is loaded once, when it is
// asked for.
import comparison from "./tracklens_comparison.js";
import doctor from "./tracklens_doctor.js";
import extraction from "./tracklens_extraction.js";
import figures from "./tracklens_figures.js";
import formats from "./tracklens_formats.js";
import images from "./tracklens_images.js";
import onnx from "./tracklens_onnx.js";
import parquet from "./tracklens_parquet.js";
import { loadSpace as space } from "./scoring.js";
import scoring from "./tracklens_scoring.js";
import temporal from "./tracklens_temporal.js";
import zarr from "./tracklens_zarr.js";

const LOADERS = { scoring, space, doctor, extraction, images, formats, parquet, zarr, onnx, temporal, figures, comparison };

/** Whether it is the beginning of a JPEG or WebP image, which the part `images` has to decode. */
export function needsDecoding(image) {
  const is = (bytes, at) => bytes.every((byte, i) => image[at + i] === byte);
  const riff = [0x52, 0x49, 0x46, 0x46];
  const webp = [0x57, 0x45, 0x42, 0x50];
  return is([0xff, 0xd8, 0xff], 0) || (is(riff, 0) && is(webp, 8));
}

/** Whether it is the beginning of an HDF5 file or a pickle, which the part `formats` reads. */
export function needsFormats(file) {
  const hdf5 = [0x89, 0x48, 0x44, 0x46, 0x0d, 0x0a, 0x1a, 0x0a];
  const isPickle = file[0] === 0x80 && file[1] >= 2 && file[1] <= 5;
  return isPickle || hdf5.every((byte, i) => file[i] === byte);
}

/** Whether it is the beginning of a Parquet file, which the part `parquet` reads. */
export function needsParquet(file) {
  return [0x50, 0x41, 0x52, 0x31].every((byte, i) => file[i] === byte);
}

/** The WebAssembly file of a part. */
export function wasmOf(part) {
  if (!Object.hasOwn(LOADERS, part)) {
    throw new Error(`the package has no part ${JSON.stringify(part)}; expected ${Object.keys(LOADERS).join(", ")}`);
  }
  return new URL(`./tracklens_${part}_bg.wasm`, import.meta.url);
}

/** What `init` of the package is; `compile` gives a part's module. */
export function initBy(compile) {
  const loaded = new Map();
  const load = async (part, module) => {
    await LOADERS[part]({ module_or_path: (await module) ?? (await compile(part)) });
  };
  return async function init(parts = Object.keys(LOADERS)) {
    const entries = Array.isArray(parts) ? parts.map((part) => [part, undefined]) : Object.entries(parts);
    const loading = entries.map(([part, module]) => {
      wasmOf(part);
      if (!loaded.has(part)) loaded.set(part, load(part, module));
      return loaded.get(part).catch((error) => {
        loaded.delete(part);
        throw error;
      });
    });
    await Promise.all(loading);
  };
}
