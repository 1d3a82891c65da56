// @ts-check
/// <reference lib="webworker" />
/**
 * Serves the page from a copy in the browser, so that it works without a network. A copy is all of
 * one version: every file is compared with its hash before it is kept, and a page stays with its
 * copy until the user asks for a newer one.
 */

/**
 * The files of this version with their SHA-256 and their size; put in here by `cargo xtask site`.
 * @type {{ version: string, files: Record<string, { hash: string, bytes: number }> }}
 */
const SITE = { version: "", files: {} };

/** Larger files are kept once they were needed. */
const LARGE = 2 * 1024 * 1024;
const CONNECTIONS = 6;
const PREFIX = "tracklens-site-";
const NAME = PREFIX + SITE.version;

const worker = /** @type {ServiceWorkerGlobalScope} */ (/** @type {unknown} */ (self));

worker.addEventListener("install", (event) => event.waitUntil(keepAll()));
worker.addEventListener("activate", (event) => event.waitUntil(forgetOthers()));
worker.addEventListener("message", ({ data, ports }) => {
  if (data === "activate") void activate().then((answer) => ports[0]?.postMessage(answer));
});
worker.addEventListener("fetch", (event) => {
  const path = pathOf(event.request);
  if (path !== null) event.respondWith(serve(path));
});

async function keepAll() {
  const cache = await caches.open(NAME);
  const paths = Object.keys(SITE.files).filter((path) => SITE.files[path].bytes <= LARGE);
  const lane = async () => {
    for (let path = paths.pop(); path !== undefined; path = paths.pop()) await keep(cache, path);
  };
  await Promise.all(Array.from({ length: CONNECTIONS }, lane));
}

async function forgetOthers() {
  const names = await caches.keys();
  await Promise.all(
    names
      .filter((name) => name.startsWith(PREFIX) && name !== NAME)
      .map((name) => caches.delete(name)),
  );
}

/** Takes over from the version before, unless another page is open that still needs it. */
async function activate() {
  const pages = await worker.clients.matchAll({ type: "window", includeUncontrolled: true });
  if (pages.length > 1) return "busy";
  await worker.skipWaiting();
  return "active";
}

/**
 * The file of the site that is asked for; `null` for anything else.
 * @param {Request} request
 */
function pathOf(request) {
  if (request.method !== "GET") return null;
  const { origin, pathname } = new URL(request.url);
  const { origin: own, pathname: scope } = new URL(worker.registration.scope);
  if (origin !== own || !pathname.startsWith(scope)) return null;
  const path = decodeURIComponent(pathname.slice(scope.length)) || "index.html";
  return path in SITE.files ? path : null;
}

/** @param {string} path */
async function serve(path) {
  const cache = await caches.open(NAME);
  return (await cache.match(urlOf(path))) ?? keep(cache, path);
}

/**
 * Fetches a file, or takes it from an older copy, and keeps it.
 * @param {Cache} cache
 * @param {string} path
 * @returns {Promise<Response>}
 */
async function keep(cache, path) {
  const url = urlOf(path);
  const ask = async (/** @type {RequestCache} */ mode) => {
    const answer = await fetch(url, { cache: mode });
    if (!answer.ok) throw new Error(`${path} could not be fetched: status ${answer.status}`);
    return answer;
  };
  // A host that tells changes apart by the second may call an old file unchanged; then it is asked
  // for the whole file.
  for (const source of [() => caches.match(url), () => ask("no-cache"), () => ask("reload")]) {
    const found = await source();
    const bytes = await found?.arrayBuffer();
    if (!found || !bytes || (await sha256(bytes)) !== SITE.files[path].hash) continue;
    // What is kept is the content: not compressed any more, and from here even where the host
    // redirected.
    const headers = new Headers(found.headers);
    for (const name of ["content-encoding", "content-length"]) headers.delete(name);
    const response = new Response(bytes, { headers });
    await cache.put(url, response.clone());
    return response;
  }
  throw new Error(`${path} is of another version of the page`);
}

/** @param {string} path */
function urlOf(path) {
  return new URL(path.split("/").map(encodeURIComponent).join("/"), worker.registration.scope).href;
}

/** @param {ArrayBuffer} bytes */
async function sha256(bytes) {
  const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
  return Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
