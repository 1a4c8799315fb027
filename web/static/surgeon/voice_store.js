// What this device keeps of recordings until the server has them: IndexedDB, because sound is too
// much for localStorage. Where a browser has none, as in some private windows, nothing is kept over
// a reload, and the page says so.

const NAME = "parfocal.voice";
const STEPS = "steps";

/**
 * Where steps of recordings are kept, by their ids.
 *
 * @typedef {object} VoiceStore
 * @property {() => Promise<import("./voice_outbox.js").Step[]>} all
 * @property {(step: import("./voice_outbox.js").Step) => Promise<boolean>} put whether it is kept
 * @property {(id: string) => Promise<void>} remove
 */

/**
 * @param {() => IDBFactory} factory may throw where storage is switched off
 * @returns {VoiceStore}
 */
export function voiceStoreOn(factory) {
  /** @type {Promise<IDBDatabase> | null} */
  let opening = null;
  const open = () => {
    opening ??= openDatabase(factory).catch((error) => {
      opening = null;
      throw error;
    });
    return opening;
  };

  return {
    async all() {
      try {
        const database = await open();
        return await done(database.transaction(STEPS).objectStore(STEPS).getAll());
      } catch {
        return [];
      }
    },

    async put(step) {
      try {
        const database = await open();
        const transaction = database.transaction(STEPS, "readwrite");
        transaction.objectStore(STEPS).put(step);
        await ended(transaction);
        return true;
      } catch {
        return false;
      }
    },

    async remove(id) {
      try {
        const database = await open();
        const transaction = database.transaction(STEPS, "readwrite");
        transaction.objectStore(STEPS).delete(id);
        await ended(transaction);
      } catch {
        // Sent again after a reload, it is known by its key.
      }
    },
  };
}

/**
 * @param {() => IDBFactory} factory
 * @returns {Promise<IDBDatabase>}
 */
async function openDatabase(factory) {
  const request = factory().open(NAME, 1);
  request.onupgradeneeded = () => request.result.createObjectStore(STEPS, { keyPath: "id" });
  return done(request);
}

/**
 * @template Result
 * @param {IDBRequest<Result>} request
 * @returns {Promise<Result>}
 */
function done(request) {
  return new Promise((resolve, reject) => {
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
}

/**
 * @param {IDBTransaction} transaction
 * @returns {Promise<void>}
 */
function ended(transaction) {
  return new Promise((resolve, reject) => {
    transaction.oncomplete = () => resolve();
    transaction.onerror = () => reject(transaction.error);
    // A full disk aborts it.
    transaction.onabort = () => reject(transaction.error);
  });
}
