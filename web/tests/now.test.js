import assert from "node:assert/strict";
import { test } from "node:test";

import { nowWords as operatorWords } from "../static/operator/now.js";
import { asCode, phaseWords, practiceFirst } from "../static/operator/session_words.js";
import { Contact } from "../static/shared/contact.js";
import { nowWords as surgeonWords } from "../static/surgeon/now.js";
import { endsSoon } from "../static/surgeon/words.js";
import { FakeTime, VIEW } from "./around.js";

const PHASES = /** @type {const} */ ([
  "ready",
  "notice",
  "inspecting",
  "questions",
  "closing",
  "completed",
  "aborted",
]);

/** 14:01 local time, in whatever time zone the test runs. */
const HEARD_AT = new Date(2026, 0, 5, 14, 1).getTime();

const SURGEON = {
  known: true,
  missed: false,
  heardAt: HEARD_AT,
  refused: false,
  unsent: false,
  unsaved: false,
  soon: false,
  over: false,
};
const OPERATOR = {
  known: true,
  missed: false,
  heardAt: HEARD_AT,
  refused: false,
  working: true,
  wrong: false,
};

/** @param {Partial<Api.OperatorView>} told @returns {Api.OperatorView} */
function operatorView(told) {
  return {
    ...VIEW,
    participant: "S-01",
    protocol: "short",
    withdrawn: false,
    may_focus_by_hand: false,
    latest_comments: [],
    log: [],
    ...told,
  };
}

test("a tablet whose link ended with its session keeps its last words, whatever becomes of the connection", () => {
  const over = { ...SURGEON, over: true, missed: true };
  const ended = { ...VIEW, phase: /** @type {const} */ ("completed") };
  assert.equal(surgeonWords({ ...over, view: ended }), "You are done. Give the tablet back.");
  assert.equal(
    surgeonWords({ ...over, view: ended, unsaved: true }),
    "Keep this page open until everything is saved.",
  );
  assert.match(surgeonWords({ ...over, view: null }), /Scan the operator’s code/);
});

test("each phase has a line of its own, which fits on a tablet’s screen", () => {
  const surgeon = PHASES.map((phase) => surgeonWords({ ...SURGEON, view: { ...VIEW, phase } }));
  const operator = PHASES.map((phase) => operatorWords({ ...OPERATOR, view: operatorView({ phase }) }));

  // For the surgeon two of the phases share a line: what to do is the same after every end of a session.
  assert.equal(new Set(surgeon).size, PHASES.length - 1);
  assert.equal(new Set(operator).size, PHASES.length);
  for (const line of surgeon) assert.ok(line.length > 0 && line.length <= 85, line);
});

test("the surgeon reads what to do about a pause, and nothing about its cause", () => {
  const paused = { ...VIEW, paused: true };
  assert.match(surgeonWords({ ...SURGEON, view: paused }), /^Wait for the operator/);
  assert.match(surgeonWords({ ...SURGEON, view: { ...paused, may_resume: true } }), /“Continue”/);
});

test("a tablet that holds something is not given back", () => {
  const ended = { ...SURGEON, view: { ...VIEW, phase: /** @type {const} */ ("completed") } };
  assert.match(surgeonWords(ended), /Give the tablet back/);
  assert.match(surgeonWords({ ...ended, unsaved: true }), /Keep this page open/);
  assert.match(surgeonWords({ ...ended, unsaved: true, unsent: true }), /comment in the box/);
});

test("a server that does not answer is reported, with the time since when", () => {
  const lost = { ...SURGEON, missed: true };
  assert.match(surgeonWords({ ...lost, view: VIEW }), /^No server since 14:01\. Comments are saved here/);
  assert.equal(surgeonWords({ ...lost, view: null }), "No server since 14:01. This page keeps trying.");
  assert.match(surgeonWords({ ...lost, heardAt: null, view: null }), /^The server cannot be reached\./);
  assert.match(operatorWords({ ...OPERATOR, missed: true, view: null }), /since 14:01/);
  const signedOut = { ...OPERATOR, missed: true, signedOut: true, view: null };
  assert.match(operatorWords(signedOut), /^You are signed out\. .* of 14:01\./);
  assert.equal(operatorWords({ ...signedOut, missed: false }), operatorWords({ ...OPERATOR, view: null }));
});

test("an expired certificate is given as the reason, and only while the server does not answer", () => {
  const time = new FakeTime();
  const contact = new Contact(time, null);
  assert.equal(contact.isCertificateOver, false, "a server without a certificate");
  contact.certifiedUntil(new Date(time.wall() + 60_000).toISOString());
  assert.equal(contact.isCertificateOver, false);
  time.wallMillis += 61_000;
  assert.equal(contact.isCertificateOver, true);

  const refused = { refused: true, missed: true };
  assert.match(
    surgeonWords({ ...SURGEON, ...refused, view: VIEW }),
    /certificate has ended: tell the operator.*saved here/,
  );
  assert.match(operatorWords({ ...OPERATOR, ...refused, view: null }), /since 14:01.*certificate has ended/);
  assert.doesNotMatch(surgeonWords({ ...SURGEON, refused: true, view: VIEW }), /certificate/);

  // The server has a new certificate now.
  contact.certifiedUntil(new Date(time.wall() + 60_000).toISOString());
  assert.equal(contact.isCertificateOver, false);
});

test("nothing is asked before it is known which session is under way", () => {
  assert.match(surgeonWords({ ...SURGEON, known: false, view: null }), /^Connecting/);
  assert.match(operatorWords({ ...OPERATOR, known: false, view: null }), /^Connecting/);
});

test("the operator sees to devices, checks, consent and the disk first", () => {
  assert.match(operatorWords({ ...OPERATOR, wrong: true, view: null }), /Ready for a trial/);
  assert.match(operatorWords({ ...OPERATOR, wrong: true, view: operatorView({}) }), /surgeon is looking/);
  assert.match(operatorWords({ ...OPERATOR, working: false, view: null }), /camera or the lens/);
  const ready = operatorView({ phase: "ready", consent_required: "3" });
  assert.match(operatorWords({ ...OPERATOR, view: ready }), /consent/);
  assert.match(operatorWords({ ...OPERATOR, view: operatorView({ unrecorded: true }) }), /disk/);
});

test("a server counts as missed 2 s after its connection was lost, or after 7 s of silence", () => {
  const time = new FakeTime();
  const contact = new Contact(time, null);
  assert.equal(contact.isMissed, false, "a page that was just opened");
  assert.equal(contact.heardAt, null);

  contact.heard();
  assert.equal(contact.heardAt, time.wall());
  time.pageMillis += 6_900;
  assert.equal(contact.isMissed, false);
  time.pageMillis += 200;
  assert.equal(contact.isMissed, true, "silent");

  contact.heard();
  contact.lost();
  time.pageMillis += 1_900;
  assert.equal(contact.isMissed, false, "a connection that comes back at once was not missed");
  time.pageMillis += 200;
  assert.equal(contact.isMissed, true);
  contact.heard();
  assert.equal(contact.isMissed, false);
});

test("the last seconds of a setting are announced calmly, and voice only if it is recorded", () => {
  assert.match(surgeonWords({ ...SURGEON, view: VIEW, soon: true }), /ends in a moment/);
  assert.match(surgeonWords({ ...SURGEON, view: VIEW }), /and write what you notice/);
  assert.match(surgeonWords({ ...SURGEON, view: { ...VIEW, voice: true } }), /say or write/);
  assert.equal(endsSoon(VIEW, 10.4), false);
  assert.equal(endsSoon(VIEW, 9.9), true);
  assert.equal(endsSoon({ ...VIEW, paused: true }, 3), false);
});

test("practice does not end as the trial does", () => {
  const over = { ...VIEW, practice: true, phase: /** @type {const} */ ("completed") };
  assert.match(surgeonWords({ ...SURGEON, view: over }), /Practice is over. Keep the tablet/);
});

test("a session without the consent that it needs is not ready, and practice is offered first", () => {
  const ready = operatorView({ phase: "ready", consent_required: "v2" });
  assert.equal(phaseWords(ready), "Consent is missing");
  assert.equal(phaseWords(operatorView({ phase: "ready" })), "Ready to start");
  const offered = [{ practice: false }, { practice: true }];
  assert.deepEqual(practiceFirst(offered), [{ practice: true }, { practice: false }]);
});

test("a code is taken as it was meant, a name is not", () => {
  assert.deepEqual(["s01", "s-0", "S-01", "anna"].map(asCode), ["S01", "S-0", "S-01", "anna"]);
});
