// What the surgeon says and takes back.

import assert from "node:assert/strict";
import { test } from "node:test";

import { Refused } from "../static/shared/api.js";
import { Comments } from "../static/surgeon/comments.js";
import { Drafts } from "../static/surgeon/drafts.js";
import { settle, VIEW } from "./around.js";
import { outboxPage } from "./outbox_page.js";

/** A page in setting 2 of session s. */
function openPage() {
  const { store, origins, newId, server, open } = outboxPage();
  const outbox = open();
  const page = { place: { session: "s", segment: "a", setting: 2, frame: 7, run: 1 } };
  const here = () => page.place;
  const voice = { heldUp: 0, isKeeping: false, durable: true, trouble: null };
  const comments = new Comments(outbox, new Drafts(store, origins, newId, "tab"), here, voice);
  outbox.subscribe((change) => comments.hear(change));
  comments.follow(VIEW);
  return Object.assign(page, { server, outbox, comments });
}

test("a refused text about another setting is not joined to the one in the box", async () => {
  const page = openPage();
  const { server, comments } = page;
  server.answers = [new Refused(422, "too long", true)];
  comments.write("about setting 2");
  comments.submit();
  page.place = { ...page.place, segment: "b", setting: 3 };
  comments.write("about setting 3");
  await settle();
  assert.equal(comments.text, "about setting 3");
  assert.equal(page.outbox.refused("s").length, 1);
  assert.match(comments.trouble, /about setting 2.* was not saved: too long/);
});

test("what is taken back stays in the record, and a withdrawal follows it", async () => {
  const { server, comments } = openPage();
  const said = comments.say({ kind: "quick", text: "Blurred" });
  assert.ok(said);
  comments.withdraw(said);
  await settle();

  const [first, second] = server.got.map(({ body }) => body);
  assert.deepEqual([first.kind, first.text], ["quick", "Blurred"]);
  assert.deepEqual([second.kind, second.text, second.segment], ["withdrawal", first.key, "a"]);
  assert.notEqual(second.key, first.key);
});

test("without a network, a comment that was taken back is no longer counted as waiting", async () => {
  const { server, comments } = openPage();
  server.answers = Array.from({ length: 9 }, () => new TypeError("Failed to fetch"));
  const slip = comments.say({ kind: "quick", text: "Blurred" });
  comments.say({ kind: "mark" });
  await settle();
  assert.equal(comments.status.text, "Saved here: 2 comments. Sent when the network is back.");
  assert.ok(slip);
  comments.withdraw(slip);
  assert.equal(comments.status.text, "Saved here: 1 comment. Sent when the network is back.");
});
