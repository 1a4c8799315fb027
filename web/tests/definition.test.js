import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import test from "node:test";
import { Definition, exactText } from "../static/researcher/definition.js";

/** @param {string | Uint8Array} bytes */
const sha256 = (bytes) => createHash("sha256").update(bytes).digest("hex");

/**
 * What a text area makes of a text (HTML, "textarea", API value).
 * @param {string} text
 */
const inTextArea = (text) => text.replace(/\r\n?/g, "\n");

const FILES = {
  "line feeds": 'name = "a"\ntitle = "é"\n',
  "carriage returns and line feeds": 'name = "a"\r\ntitle = "é"\r\n',
  "a byte order mark": '\uFEFFname = "a"\r\n',
};

for (const [what, text] of Object.entries(FILES)) {
  test(`a file with ${what} is sent byte for byte`, () => {
    const bytes = Buffer.from(text, "utf8");
    const exact = exactText(bytes);
    const definition = new Definition();
    definition.take(exact, inTextArea(exact));
    assert.equal(sha256(definition.toSend(inTextArea(exact))), sha256(bytes));
  });
}

test("a text that was changed or typed on the page is sent as it stands there", () => {
  const definition = new Definition();
  assert.equal(definition.toSend("typed"), "typed");
  definition.take("a\r\nb", "a\nb");
  assert.equal(definition.toSend("a\nc"), "a\nc");
});

test("a file that is not UTF-8 is refused", () => {
  assert.throws(() => exactText(Buffer.from([0x6e, 0xe9, 0x0a])), TypeError);
});
