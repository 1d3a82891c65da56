// @ts-check
/**
 * Entry of the page: loads the package, then the application. What keeps the page from working is
 * reported here.
 */

// A file dropped before the application is ready must not make the browser leave the page.
for (const type of ["dragover", "drop"]) {
  window.addEventListener(type, (event) => event.preventDefault());
}

if (new URLSearchParams(location.search).has("embed")) document.documentElement.dataset.embed = "";

try {
  const { default: init } = await import("./pkg/index.js");
  await init(["scoring"]);
  const { start } = await import("./app.js");
  start();
} catch (error) {
  const detail = error instanceof Error ? error.message : String(error);
  const place = /** @type {HTMLElement} */ (document.querySelector("#boot-error"));
  const message = document.createElement("p");
  message.className = "notice";
  message.dataset.kind = "error";
  message.setAttribute("role", "alert");
  message.textContent =
    "tracklens could not be loaded. It needs WebAssembly with SIMD: Chrome or Edge 91, Firefox " +
    "89, Safari 16.4 or " +
    `later. If the browser is a recent one, reload the page. (${detail})`;
  place.append(message);
  place.hidden = false;
  throw error;
}
