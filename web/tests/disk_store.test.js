import assert from "node:assert/strict";
import { test } from "node:test";

import { diskStoreOn } from "../static/surgeon/disk_store.js";

/** @typedef {{ id: string }} Thing */

/**
 * A browser's databases, with as much of IndexedDB as the store uses. `close` closes the open ones, as browsers on
 * tablets do to a page that was out of sight.
 */
function fakeFactory() {
  /** @type {Map<string, Thing>} */
  const kept = new Map();
  let opened = 0;
  let closed = 0;

  /** @param {unknown} result */
  const request = (result) => {
    const made = { result, onsuccess: () => {} };
    setImmediate(() => made.onsuccess());
    return made;
  };
  const transaction = () => {
    const made = {
      objectStore: () => ({
        getAll: () => request([...kept.values()]),
        put: (/** @type {Thing} */ thing) => void kept.set(thing.id, thing),
        delete: (/** @type {string} */ id) => void kept.delete(id),
      }),
      commit: () => {},
      oncomplete: () => {},
    };
    setImmediate(() => made.oncomplete());
    return made;
  };
  const open = () => {
    opened += 1;
    const number = opened;
    return request({
      transaction: () => {
        if (number <= closed)
          throw new DOMException("The database connection is closing.", "InvalidStateError");
        return transaction();
      },
    });
  };
  return {
    kept,
    opened: () => opened,
    close: () => {
      closed = opened;
    },
    factory: () => /** @type {IDBFactory} */ (/** @type {unknown} */ ({ open })),
  };
}

test("a database that the browser has closed is opened again, and nothing is told as lost", async () => {
  const browser = fakeFactory();
  /** @type {import("../static/surgeon/disk_store.js").DiskStore<Thing>} */
  const store = diskStoreOn(browser.factory, "parfocal.voice");
  assert.equal(await store.put({ id: "one" }), true);

  browser.close();
  const both = await Promise.all([store.put({ id: "two" }), store.put({ id: "three" })]);
  assert.deepEqual(both, [true, true]);
  assert.deepEqual(await store.all(), [{ id: "one" }, { id: "two" }, { id: "three" }]);

  browser.close();
  await store.remove("one");
  assert.deepEqual([...browser.kept.keys()], ["two", "three"]);
  browser.close();
  assert.equal((await store.all())?.length, 2);
  assert.equal(browser.opened(), 4, "once each time");
});
