import assert from "node:assert/strict";
import { test } from "node:test";

import { announce } from "../static/shared/dom.js";

test("what only counts is announced once", () => {
  const heard = /** @type {any} */ ({ textContent: "" });
  announce(heard, "The tablet has not answered for 4 s.");
  announce(heard, "The tablet has not answered for 5 s.");
  assert.equal(heard.textContent, "The tablet has not answered for 4 s.");

  announce(heard, "");
  announce(heard, "The tablet has not answered for 6 s.");
  assert.equal(heard.textContent, "The tablet has not answered for 6 s.");
  announce(heard, "Recording mosaics: 59 s, 2950 frames, 4.7 GB.");
  announce(heard, "Recording mosaics: 58 s, 2900 frames, 4.6 GB.");
  assert.match(heard.textContent, /59 s/);
});
