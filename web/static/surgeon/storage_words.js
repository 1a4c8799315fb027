// Finds out whether this browser can store comments and answers over a reload, and says what to do if it cannot.

import { say } from "../shared/language.js";

/** Written and removed at once, to test whether the storage works. */
const TRIAL = "parfocal.trial";

/**
 * Advice for the surgeon if the browser cannot store anything; empty if it can.
 *
 * @param {import("../shared/storage.js").Store} store
 */
export function storageAdvice(store) {
  const keeps = store.write(TRIAL, "1");
  store.remove(TRIAL);
  if (keeps) return "";
  return say("storage-advice");
}

/** Asks the browser not to clear its storage when the device runs out of space. */
export async function keepStorage() {
  try {
    if (!(await navigator.storage?.persisted?.())) await navigator.storage?.persist?.();
  } catch {
    // If the browser refuses, it may clear its storage at any time. The page says what is not saved yet.
  }
}
