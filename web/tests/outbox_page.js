// A page of the surgeon's as far as its outbox needs it.

import { Origins } from "../static/surgeon/origin.js";
import { Outbox } from "../static/surgeon/outbox.js";
import { countedIds, FakeDisk, FakeServer, FakeTime, fakeStore } from "./around.js";

/** @typedef {import("../static/surgeon/outbox.js").Entry} Entry */

/** A page on `store` and `spare`: an outbox, its server and its time. */
export function outboxPage(
  store = fakeStore(),
  time = new FakeTime(),
  newId = countedIds(),
  spare = /** @type {FakeDisk<Entry>} */ (new FakeDisk()),
) {
  const server = new FakeServer();
  const origins = new Origins(store, time, newId);
  const open = () =>
    new Outbox({ store, spare, origins, send: server.send, newId, wall: time.wall, later: time.later });
  return { store, spare, time, server, origins, newId, open };
}
