// Whether this browser keeps what is said over a reload, and what to do where it does not.

/** Written and taken back at once, to see whether it can be. */
const TRIAL = "parfocal.trial";

/**
 * What to tell the surgeon of a browser that keeps nothing; empty where it keeps things.
 *
 * @param {import("../shared/storage.js").Store} store
 */
export function storageAdvice(store) {
  const keeps = store.write(TRIAL, "1");
  store.remove(TRIAL);
  if (keeps) return "";
  return (
    "This browser keeps nothing on the device: its storage is full or switched off, as in a private window. " +
    "What you say waits on this page until it is saved, so do not close or reload the page."
  );
}

/** Asks the browser not to clear what it keeps when the device runs short of room. */
export async function keepStorage() {
  try {
    if (!(await navigator.storage?.persisted?.())) await navigator.storage?.persist?.();
  } catch {
    // A browser that was not willing keeps things as long as it likes. The page says what is not saved yet.
  }
}
