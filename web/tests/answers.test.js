import assert from "node:assert/strict";
import { test } from "node:test";

import { sendLeftAnswers } from "../static/surgeon/answers.js";
import { Drafts } from "../static/surgeon/drafts.js";
import { settle, VIEW } from "./around.js";
import { outboxPage } from "./outbox_page.js";

test("a text left half-written is sent once its questions are gone, and an unconfirmed ranking is removed", async () => {
  const { store, origins, newId, server, open } = outboxPage();
  const outbox = open();
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
