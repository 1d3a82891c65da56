// The package in Node.js: the WebAssembly file is read from beside this one.
import { readFile } from "node:fs/promises";
import load from "./tracklens.js";

let loading;

export default function init(module) {
  loading ??= (async () => {
    const bytes = module ?? (await readFile(new URL("./tracklens_bg.wasm", import.meta.url)));
    await load({ module_or_path: bytes });
  })().catch((error) => {
    loading = undefined;
    throw error;
  });
  return loading;
}

export * from "./tracklens.js";
