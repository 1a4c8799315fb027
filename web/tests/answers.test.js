import assert from "node:assert/strict";
import { test } from "node:test";

import { sendLeftAnswers } from "../static/surgeon/answers.js";
import { Drafts } from "../static/surgeon/drafts.js";
import { Origins } from "../static/surgeon/origin.js";
import { Outbox } from "../static/surgeon/outbox.js";
import { countedIds, FakeDisk, FakeServer, FakeTime, fakeStore, settle, VIEW } from "./around.js";

test("a text left half-written is sent once its questions are gone, and an unconfirmed ranking is removed", async () => {
  const store = fakeStore();
  const newId = countedIds();
  const time = new FakeTime();
  const origins = new Origins(store, time, newId);
  const server = new FakeServer();
  const spare = /** @type {FakeDisk<import("../static/surgeon/outbox.js").Entry>} */ (new FakeDisk());
  const outbox = new Outbox({
    store,
    spare,
    origins,
    send: server.send,
    newId,
    wall: time.wall,
    later: time.later,
  });
  const drafts = new Drafts(store, origins, newId, "tab");
  drafts.open("answer.s/closing/remarks").write(" Half a thought ");
  drafts.open("answer.s/closing/order").write([2, 1]);

  sendLeftAnswers(outbox, drafts, { ...VIEW, phase: "closing", segment: null, paused: true });
  await settle();
  assert.equal(server.got.length, 0);
  assert.equal(drafts.of("answer.").length, 2, "both are still being given");

  sendLeftAnswers(outbox, drafts, { ...VIEW, phase: "aborted", segment: null });
  await settle();
  const sent = server.got.map(({ body }) => [body.segment, body.question, body.value]);
  assert.deepEqual(sent, [[null, "remarks", "Half a thought"]]);
  assert.deepEqual(drafts.of("answer."), []);
});
