// The package in Node.js: WebAssembly files are read from beside this one.
import { readFile } from "node:fs/promises";
import { initBy, wasmOf } from "./parts.js";

export async function compile(part) {
  return WebAssembly.compile(await readFile(wasmOf(part)));
}

export default initBy(compile);

export { needsDecoding, needsFormats } from "./parts.js";
export * from "./tracklens_scoring.js";
export * from "./tracklens_doctor.js";
export * from "./tracklens_extraction.js";
export * from "./tracklens_images.js";
export * from "./tracklens_formats.js";
export * from "./tracklens_onnx.js";
export * from "./tracklens_temporal.js";
export * from "./tracklens_figures.js";
export * from "./tracklens_comparison.js";
