// The service worker that opens this page without a network. Browsers allow one only if the page is encrypted and its
// certificate trusted, or if the page comes from this machine. Otherwise the page works all the same, but needs the
// network to be opened.

const WORKER = "/surgeon/worker.js";
const PAGE = "/surgeon";

/** The names of the worker's caches begin with this (see `offline/worker.js`). */
const FAMILY = "parfocal-surgeon-";

/** Registers the worker, so that this browser keeps the page. */
export async function keepPage() {
  try {
    await navigator.serviceWorker?.register(WORKER, { scope: PAGE });
  } catch {
    // No space, storage switched off, or a certificate that is not trusted: the page works without the worker.
  }
}

/** Removes the kept page. If the tablet's link is no longer valid, this browser must not open the page by itself. */
export async function forgetPage() {
  try {
    const names = await caches.keys();
    const ours = names.filter((name) => name.startsWith(FAMILY));
    await Promise.all(ours.map(async (name) => (await caches.open(name)).delete(PAGE)));
  } catch {
    // Without a secure context there are no caches, and nothing is kept.
  }
}
