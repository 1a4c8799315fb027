import assert from "node:assert/strict";
import { test } from "node:test";

import { judge } from "../static/surgeon/room.js";

test("a keyboard makes the page leave out what is not needed for typing", () => {
  assert.deepEqual(judge({ free: 1024, greatest: 1024, isTyping: true }), { keyboard: false, typing: false });
  assert.deepEqual(judge({ free: 640, greatest: 1024, isTyping: true }), { keyboard: true, typing: true });
  assert.deepEqual(judge({ free: 400, greatest: 768, isTyping: false }), { keyboard: false, typing: false });
});

test("in a low window with a real keyboard one types with the picture in view, too", () => {
  assert.deepEqual(judge({ free: 500, greatest: 500, isTyping: true }), { keyboard: false, typing: true });
});
