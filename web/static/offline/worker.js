// Keeps the surgeon's page and its files in this browser, so that the page opens without a network.
// It keeps nothing else: no answer of the server's interface, nothing of a session, no other page.
// The server sends this file after a line that sets `self.offline`, so that each version of the
// program has a worker of its own.

const worker = /** @type {ServiceWorkerGlobalScope} */ (/** @type {unknown} */ (self));
const { version, files } = worker.offline;

/** Every cache of every version has a name that begins so. */
const FAMILY = "parfocal-surgeon-";
const CACHE = FAMILY + version;

const PAGE = "/surgeon";

/** The header that only the surgeon's page has. It names the version of the files that the page asks for. */
const PAGE_VERSION = "parfocal-page-version";

/** A network that swallows everything must not keep a surgeon waiting for a page that is here. */
const PATIENCE_MS = 4000;

worker.addEventListener("install", (event) => event.waitUntil(keepEverything()));
worker.addEventListener("activate", (event) => event.waitUntil(forgetOtherVersions()));
worker.addEventListener("fetch", (event) => {
  const { request } = event;
  const { origin, pathname } = new URL(request.url);
  if (request.method !== "GET" || origin !== worker.location.origin) return;

  if (request.mode === "navigate" && pathname === PAGE) event.respondWith(openPage(request));
  else if (files.includes(pathname)) event.respondWith(openFile(request));
});

/** A browser has all of a version or nothing of it: where one file fails, this worker is given up. */
async function keepEverything() {
  const cache = await caches.open(CACHE);
  await cache.addAll([...files]);

  const answer = await fetch(PAGE, { cache: "no-store", redirect: "manual" });
  if (isPageOf(version, answer)) await cache.put(PAGE, answer);
  // The page that is open has loaded all its files, so the newer worker need not wait for its end.
  await worker.skipWaiting();
}

async function forgetOtherVersions() {
  const names = await caches.keys();
  const others = names.filter((name) => name.startsWith(FAMILY) && name !== CACHE);
  await Promise.all(others.map((name) => caches.delete(name)));
}

/**
 * The page as the server has it; the one that is kept where the server does not answer.
 *
 * @param {Request} request
 * @returns {Promise<Response>}
 */
async function openPage(request) {
  const cache = await caches.open(CACHE);
  const kept = await cache.match(PAGE);

  try {
    const answer = await fetch(request, kept ? { signal: AbortSignal.timeout(PATIENCE_MS) } : undefined);
    // A proxy answers so while the server is down.
    if (kept && answer.status >= 500) return kept;

    if (isPageOf(version, answer)) await cache.put(PAGE, answer.clone());
    // The tablet is not let in any more, or the session is over for it.
    else if (!answer.headers.has(PAGE_VERSION)) await cache.delete(PAGE);
    return answer;
  } catch {
    return kept ?? Response.error();
  }
}

/**
 * @param {Request} request
 * @returns {Promise<Response>}
 */
async function openFile(request) {
  const cache = await caches.open(CACHE);
  return (await cache.match(request)) ?? fetch(request);
}

/**
 * Whether `answer` is the surgeon's page, made for the files of `wanted`.
 *
 * @param {string} wanted
 * @param {Response} answer
 */
function isPageOf(wanted, answer) {
  return answer.ok && !answer.redirected && answer.headers.get(PAGE_VERSION) === wanted;
}
