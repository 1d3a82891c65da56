// The package in Node.js: WebAssembly files are read from beside this one.
import { readFile } from "node:fs/promises";
import { initBy, wasmOf } from "./parts.js";

export async function compile(part) {
  return WebAssembly.compile(await readFile(wasmOf(part)));
}

export default initBy(compile);

export * from "./all.js";
