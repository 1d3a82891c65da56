// The package in a browser: the WebAssembly file is fetched from beside this one.
import load from "./tracklens.js";

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

export * from "./tracklens.js";
