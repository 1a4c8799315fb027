// Storage in IndexedDB. It can report when something is on the disk itself, so that it survives if the tablet loses its
// power. If a browser has no IndexedDB, as in some private windows, nothing is kept, and the page says so.

const KEPT = "steps";

/** If the disk cannot be read, it is tried again after this time. */
export const READ_AGAIN_MS = 2000;

/**
 * A store of things by their ids.
 *
 * @template {{ id: string }} Thing
 * @typedef {object} DiskStore
 * @property {() => Promise<Thing[] | null>} all resolves to null if the disk cannot be read now
 * @property {(thing: Thing) => Promise<boolean>} put resolves to whether the thing is on the disk
 * @property {(id: string) => Promise<void>} remove
 */

/**
 * The store called `name`. It is opened at its first use.
 *
 * @template {{ id: string }} Thing
 * @param {() => IDBFactory} factory may throw where storage is switched off
 * @param {string} name
 * @returns {DiskStore<Thing>}
 */
export function diskStoreOn(factory, name) {
  /** @type {Promise<IDBDatabase> | null} */
  let opening = null;
  const open = () => {
    opening ??= openDatabase(factory, name).catch((error) => {
      opening = null;
      throw error;
    });
    return opening;
  };

  /**
   * Begins a transaction.
   *
   * @param {IDBTransactionMode} mode
   * @param {IDBTransactionOptions} [options]
   */
  async function begin(mode, options) {
    const opened = open();
    const database = await opened;
    try {
      return database.transaction(KEPT, mode, options);
    } catch {
      // The browser has closed the database, as tablets do to a page that was out of sight. It can be opened again.
      if (opening === opened) opening = null;
      return (await open()).transaction(KEPT, mode, options);
    }
  }

  return {
    async all() {
      try {
        const transaction = await begin("readonly");
        return await done(transaction.objectStore(KEPT).getAll());
      } catch {
        return null;
      }
    },

    async put(thing) {
      try {
        // By default browsers leave it to the operating system when data reach the disk.
        const transaction = await begin("readwrite", { durability: "strict" });
        transaction.objectStore(KEPT).put(thing);
        // By itself the browser commits only after the page has heard of it, and never if the page closes before.
        transaction.commit();
        await ended(transaction);
        return true;
      } catch {
        return false;
      }
    },

    async remove(id) {
      try {
        const transaction = await begin("readwrite");
        transaction.objectStore(KEPT).delete(id);
        await ended(transaction);
      } catch {
        // If the thing is sent again after a reload, the server recognises its key.
      }
    },
  };
}

/**
 * @param {() => IDBFactory} factory
 * @param {string} name
 * @returns {Promise<IDBDatabase>}
 */
async function openDatabase(factory, name) {
  const request = factory().open(name, 1);
  request.onupgradeneeded = () => request.result.createObjectStore(KEPT, { keyPath: "id" });
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
    // A full disk aborts the transaction.
    transaction.onabort = () => reject(transaction.error);
  });
}
