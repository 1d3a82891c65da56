// Extraction on WebGPU, a part of its own: several megabytes that only who imports this file
// fetches.
import load from "./tracklens_gpu.js";

let loading;

export default function init(module) {
  loading ??= load(module === undefined ? undefined : { module_or_path: module }).then(
    () => undefined,
    (error) => {
      loading = undefined;
      throw error;
    },
  );
  return loading;
}

export * from "./tracklens_gpu.js";
