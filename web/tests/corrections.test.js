import assert from "node:assert/strict";
import { test } from "node:test";

import { consentWords, deeds, lacksConsent } from "../static/operator/session_words.js";
import {
  answerName,
  correctable,
  hint,
  read,
  soFar,
  written,
} from "../static/researcher/correction_words.js";
import { commentWords } from "../static/researcher/timeline_words.js";

test("an answer is read as it is written, by what its question takes", () => {
  assert.equal(read("likert", " 5 "), 5);
  assert.equal(read("visual-analogue", "0"), 0);
  assert.deepEqual(read("sus", "4, 2,3 ,1"), [4, 2, 3, 1]);
  assert.deepEqual(read("ranking", "2"), [2]);
  assert.equal(written([4, 2]), "4, 2");
  for (const wrong of ["", "5, 6", "five", "-1", "5.5", "1000"]) assert.equal(read("likert", wrong), null);
  assert.equal(read("sus", "1,,2"), null);
  assert.notEqual(hint("likert"), hint("sus"));
});

test("a surgeon's words cannot be corrected, and what was corrected is corrected further", () => {
  const line = { question: "q", text: "Sharp?", setting: 2, value: 3, corrected: 5 };
  const said = { ...line, value: "fine" };
  // @ts-expect-error only the fields that the list uses
  assert.deepEqual(correctable([line, said]), [line]);
  assert.equal(soFar(line), 5);
  assert.equal(soFar({ value: 3 }), 3);
  assert.equal(answerName(line), "Setting 2: Sharp?");
  assert.equal(answerName({ ...line, setting: null }), "Closing: Sharp?");
});

test("an erased comment says when it was erased", () => {
  const comment = { kind: "text", text: "", erased: "2026-03-01T09:00:00Z" };
  // @ts-expect-error only the fields that the text uses
  assert.equal(commentWords(comment), "Erased on 2026-03-01");
});

/** A session as the operator sees it, ready to start. @param {object} more @returns {Api.OperatorView} */
function ready(more) {
  // @ts-expect-error only the fields that the text uses
  return { phase: "ready", paused: false, setting: 0, withdrawn: false, ...more };
}

test("a session that requires consent offers no start before it is recorded", () => {
  const named = (/** @type {Api.OperatorView} */ view) => deeds(view).map(({ deed }) => deed);
  const consent = { text_version: "2.1", given_on: "2026-03-01", obtained_by: "KM", medium: "paper" };
  const required = { consent_required: "2.1" };
  assert.deepEqual(named(ready(required)), ["consent", "abort"]);
  assert.match(consentWords(ready(required)), /requires the participant’s consent to version 2.1/);
  assert.deepEqual(named(ready({ ...required, consent })), ["start", "abort"]);
  assert.match(
    consentWords(ready({ ...required, consent })),
    /on paper, given on 2026-03-01, obtained by KM/,
  );
  assert.equal(lacksConsent(ready({ ...required, consent: { ...consent, text_version: "2.0" } })), true);
  assert.deepEqual(named(ready({})), ["consent", "start", "abort"]);
  assert.equal(consentWords(ready({})), "");
});

test("a session is withdrawn once, after its end", () => {
  const named = (/** @type {Api.OperatorView} */ view) => deeds(view).map(({ deed }) => deed);
  assert.deepEqual(named(ready({ phase: "aborted" })), ["dismiss", "withdraw"]);
  assert.deepEqual(named(ready({ phase: "aborted", withdrawn: true })), ["dismiss"]);
});
