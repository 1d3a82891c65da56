// The package in a browser: WebAssembly files are fetched from beside this one.
import { initBy, wasmOf } from "./parts.js";

export async function compile(part) {
  const url = wasmOf(part);
  const response = await fetch(url).catch((error) => error);
  if (!response.ok) {
    const reason = response instanceof Error ? response.message : `status ${response.status}`;
    throw new Error(`${url.pathname} could not be fetched (${reason})`);
  }
  // Streaming insists on the type; a server that does not know it should not be the end.
  return response.headers.get("content-type")?.startsWith("application/wasm")
    ? WebAssembly.compileStreaming(response)
    : WebAssembly.compile(await response.arrayBuffer());
}

export default initBy(compile);

export * from "./all.js";
