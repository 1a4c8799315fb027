// Keeps the surgeon's page and its files in this browser, so that the page opens without a network.
// It keeps nothing else: no answer of the HTTP interface, no data of a session, no other page.
// The server puts a line that sets `self.offline` in front of this file, so that each version of the program has a
// worker of its own.

const worker = /** @type {ServiceWorkerGlobalScope} */ (/** @type {unknown} */ (self));
const { version, files } = worker.offline;

/** The names of the caches of all versions begin with this. */
const FAMILY = "parfocal-surgeon-";
const CACHE = FAMILY + version;

const PAGE = "/surgeon";

/** A header that only the surgeon's page has. It names the version of the files that the page loads. */
const PAGE_VERSION = "parfocal-page-version";

/** How long to wait for the server if the page is kept here. A dead network must not keep a surgeon waiting. */
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

/** Keeps all files of this version. If one fails, the browser drops this worker, so no version is kept in part. */
async function keepEverything() {
  const cache = await caches.open(CACHE);
  await cache.addAll([...files]);

  const answer = await fetch(PAGE, { cache: "no-store", redirect: "manual" });
  if (isPageOf(version, answer)) await cache.put(PAGE, answer);
  // An open page has already loaded all its files, so the newer worker need not wait until it is closed.
  await worker.skipWaiting();
}

async function forgetOtherVersions() {
  const names = await caches.keys();
  const others = names.filter((name) => name.startsWith(FAMILY) && name !== CACHE);
  await Promise.all(others.map((name) => caches.delete(name)));
}

/**
 * The server's page, or the kept one if the server does not answer in time.
 *
 * @param {Request} request
 * @returns {Promise<Response>}
 */
async function openPage(request) {
  const cache = await caches.open(CACHE);
  const kept = await cache.match(PAGE);

  const controller = new AbortController();
  const timer = kept && setTimeout(() => controller.abort(), PATIENCE_MS);
  try {
    const answer = await fetch(request, { signal: controller.signal });
    // The network may die after the headers. A page that came in part is no answer, and must not replace the kept one.
    await answer.clone().arrayBuffer();
    if (timer) clearTimeout(timer);
    // A proxy answers with such a status while the server is down.
    if (kept && answer.status >= 500) return kept;

    await keepPage(cache, answer);
    return answer;
  } catch {
    return kept ?? Response.error();
  }
}

/**
 * Keeps a copy of `answer` if it is this version's page, and forgets the page if the tablet is no longer let in or the
 * session is over for it. A device without room keeps no copy; the answer is good all the same.
 *
 * @param {Cache} cache
 * @param {Response} answer
 */
async function keepPage(cache, answer) {
  try {
    if (isPageOf(version, answer)) await cache.put(PAGE, answer.clone());
    else if (!answer.headers.has(PAGE_VERSION)) await cache.delete(PAGE);
  } catch {
    await cache.delete(PAGE).catch(() => false);
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
