// The service worker that opens this page without a network. Browsers have one only where the page
// is encrypted and its certificate trusted, or comes from this machine. Elsewhere the page works as
// it does, and needs the network to be opened.

const WORKER = "/surgeon/worker.js";
const PAGE = "/surgeon";

/** How the worker's caches are called: `offline/worker.js`. */
const FAMILY = "parfocal-surgeon-";

/** Lets this browser keep the page. */
export async function keepPage() {
  try {
    await navigator.serviceWorker?.register(WORKER, { scope: PAGE });
  } catch {
    // No room, storage switched off, or a certificate that is not trusted: the page does without.
  }
}

/** The tablet's link opens nothing any more: this browser is not to open the page by itself either. */
export async function forgetPage() {
  try {
    const names = await caches.keys();
    const ours = names.filter((name) => name.startsWith(FAMILY));
    await Promise.all(ours.map(async (name) => (await caches.open(name)).delete(PAGE)));
  } catch {
    // Without a secure context there are no caches, and nothing is kept.
  }
}
