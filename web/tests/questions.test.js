import assert from "node:assert/strict";
import { test } from "node:test";

import { Drafts } from "../static/surgeon/drafts.js";
import { Origins } from "../static/surgeon/origin.js";
import { answerTo, drawnOrder, onTopOf, ordinal, Questionnaire } from "../static/surgeon/questions.js";
import { placeAt } from "../static/surgeon/ranking.js";
import { countedIds, FakeTime, fakeStore } from "./around.js";

/** @type {Api.Question} */
const SHARPNESS = { id: "sharpness", kind: "likert", text: "Sharp?", points: 7, low: "Not", high: "Very" };
/** @type {Api.Question} */
const REMARKS = { id: "remarks", kind: "text", text: "Remarks?", optional: true };
/** @type {Api.Question} */
const ORDER = { id: "order", kind: "ranking", text: "Which was best?" };
/** @type {Api.Question} */
const USABILITY = {
  id: "usability",
  kind: "sus",
  text: "Usability",
  items: Array.from({ length: 10 }, (_, item) => `Item ${item + 1}`),
  low: "Strongly disagree",
  high: "Strongly agree",
};

const UNCONFIRMED = "Kept on this device until you tap “This order is right”";

/** A page with questions about three settings. `given` holds the answers that it sends. */
function openPage(store = fakeStore()) {
  const time = new FakeTime();
  const newId = countedIds();
  const drafts = new Drafts(store, new Origins(store, time, newId), newId, "tab");
  /** @type {{ question: string, value: unknown, part: number | null }[]} */
  const given = [];

  /** @type {import("../static/surgeon/questions.js").Context} */
  const context = {
    settings: 3,
    said: [["Blurred"], [], ["Sharp", "It wanders"]],
    // The order drawn from this lot is 1, 2, 3.
    lot: "s2",
    later: time.later,
    draft: ({ id }) => drafts.open(`answer.s/1/${id}`),
    give: ({ id }, value, part) => given.push({ question: id, value, part }),
  };
  /**
   * @template {import("../static/surgeon/questions.js").AnyAnswer} Kind
   * @param {Api.Question} question
   * @param {Api.AnswerValue} [answered]
   * @returns {Kind}
   */
  const ask = (question, answered) => /** @type {Kind} */ (answerTo(question, answered, context));
  return { store, time, given, ask };
}

/** @typedef {import("../static/surgeon/questions.js").ScaleAnswer} ScaleAnswer */
/** @typedef {import("../static/surgeon/questions.js").TextAnswer} TextAnswer */
/** @typedef {import("../static/surgeon/questions.js").ItemsAnswer} ItemsAnswer */
/** @typedef {import("../static/surgeon/questions.js").RankingAnswer} RankingAnswer */

test("a 0 among points leaves what was there, and anything else replaces it", () => {
  assert.deepEqual(onTopOf([4, 0, 2], [0, 3, 5]), [4, 3, 5]);
  assert.deepEqual(onTopOf(undefined, [0, 3]), [0, 3]);
  assert.equal(onTopOf(3, 5), 5);
  assert.equal(onTopOf("before", "after"), "after");
});

test("places are named as in English", () => {
  const names = [1, 2, 3, 4, 11, 12, 13, 21, 22, 23, 111].map(ordinal);
  const expected = ["1st", "2nd", "3rd", "4th", "11th", "12th", "13th", "21st", "22nd", "23rd", "111th"];
  assert.deepEqual(names, expected);
});

test("a point is given when it is chosen, and is unanswered until then", () => {
  const { ask, given } = openPage();
  /** @type {ScaleAnswer} */
  const sharpness = ask(SHARPNESS);
  assert.equal(sharpness.unanswered, true);

  sharpness.choose(5);
  assert.deepEqual(given, [{ question: "sharpness", value: 5, part: null }]);
  assert.deepEqual([sharpness.status, sharpness.unanswered], ["Saving…", false]);

  sharpness.show("waiting");
  assert.equal(sharpness.unanswered, false, "what is kept on the device is answered");
  sharpness.show("refused", "not on the scale");
  assert.deepEqual([sharpness.status, sharpness.unanswered], ["not on the scale", true]);
});

test("an answer given elsewhere is shown, one that is known already changes nothing", () => {
  const { ask, given } = openPage();
  /** @type {ScaleAnswer} */
  const sharpness = ask(SHARPNESS, 3);
  assert.deepEqual([sharpness.point, sharpness.status], [3, "Saved"]);

  sharpness.show("waiting");
  sharpness.take(3);
  assert.equal(sharpness.reached, "waiting");
  sharpness.take(6);
  assert.deepEqual([sharpness.point, sharpness.status], [6, "Saved"]);
  assert.deepEqual(given, [], "nothing of it is given again");
});

test("a text is given at the first pause of 900 ms, and at once when the surgeon goes on", async () => {
  const { ask, given, time } = openPage();
  /** @type {TextAnswer} */
  const remarks = ask(REMARKS);
  remarks.write("Good");
  await time.pass(899);
  remarks.write(" Good at rest ");
  await time.pass(899);
  assert.deepEqual(given, []);
  assert.equal(remarks.status, "Writing…");

  await time.pass(1);
  assert.deepEqual(given, [{ question: "remarks", value: "Good at rest", part: null }]);
  assert.equal(remarks.text, " Good at rest ", "what stands in the field is left alone");

  remarks.write("Better");
  remarks.giveNow();
  remarks.giveNow();
  await time.pass(5000);
  assert.deepEqual(given.slice(1), [{ question: "remarks", value: "Better", part: null }]);
});

test("a text half-written before a reload is given by the next page", async () => {
  const { ask, store } = openPage();
  /** @type {TextAnswer} */ (ask(REMARKS)).write("Half");

  const next = openPage(store);
  /** @type {TextAnswer} */
  const remarks = next.ask(REMARKS, "Earlier");
  assert.equal(remarks.text, "Half");
  await next.time.pass(900);
  assert.deepEqual(next.given, [{ question: "remarks", value: "Half", part: null }]);
});

test("a full device loses no text, and a text being written is not replaced by another device's", async () => {
  const { ask, given, store, time } = openPage();
  store.full = true;
  /** @type {TextAnswer} */
  const remarks = ask(REMARKS);
  remarks.write("Mine");
  remarks.take("Theirs");
  assert.equal(remarks.text, "Mine");
  await time.pass(900);
  assert.deepEqual(given, [{ question: "remarks", value: "Mine", part: null }]);

  remarks.take("Theirs", true);
  assert.equal(remarks.text, "Mine", "nor is one while the surgeon is in the field");
  remarks.take("Theirs", false);
  assert.equal(remarks.text, "Theirs");
});

test("a text that was refused stays, and is not replaced by what the server has", () => {
  const { ask } = openPage();
  /** @type {TextAnswer} */
  const remarks = ask(REMARKS, "Short");
  remarks.write("Too long");
  remarks.giveNow();
  remarks.show("refused", "too long");
  remarks.take("Short");
  remarks.want();
  remarks.take("Short");
  assert.deepEqual([remarks.text, remarks.status], ["Too long", "too long"]);

  remarks.write("Shorter");
  remarks.giveNow();
  remarks.show("saved");
  remarks.take("Theirs");
  assert.equal(remarks.text, "Theirs");
});

test("an emptied text gives nothing, and says so where an answer stands", () => {
  const { ask, given } = openPage();
  /** @type {TextAnswer} */
  const remarks = ask(REMARKS, "Earlier");
  remarks.write("  ");
  remarks.giveNow();
  assert.deepEqual(given, []);
  assert.equal(remarks.status, "The earlier answer stays until you write another.");
});

test("each item of the usability scale is given alone, and all ten make an answer", () => {
  const { ask, given } = openPage();
  /** @type {ItemsAnswer} */
  const usability = ask(USABILITY);
  usability.choose(2, 4);
  assert.deepEqual(given, [{ question: "usability", value: [0, 0, 4, 0, 0, 0, 0, 0, 0, 0], part: 2 }]);

  usability.show("saved");
  assert.deepEqual([usability.status, usability.unanswered], ["1 of 10 answered · Saved", true]);
  usability.take([1, 1, 4, 1, 1, 1, 1, 1, 1, 0]);
  assert.deepEqual([usability.status, usability.unanswered], ["9 of 10 answered · Saved", true]);

  usability.choose(9, 5);
  usability.show("saved");
  assert.deepEqual([usability.status, usability.unanswered], ["Saved", false]);
  assert.deepEqual(usability.points, [1, 1, 4, 1, 1, 1, 1, 1, 1, 5]);
});

test("an order counts once it is confirmed, and from then on with every move", () => {
  const { ask, given } = openPage();
  /** @type {RankingAnswer} */
  const order = ask(ORDER);
  assert.deepEqual(order.order, [1, 2, 3]);
  assert.equal(order.begun, null);

  assert.equal(order.move(2, 0), 3);
  assert.deepEqual([order.order, order.status, order.unanswered], [[3, 1, 2], UNCONFIRMED, true]);
  order.show("saved");
  assert.equal(order.status, UNCONFIRMED, "it does not say saved before it is");
  assert.deepEqual(given, []);

  order.confirm();
  order.move(1, 2);
  assert.deepEqual(
    given.map(({ value }) => value),
    [
      [3, 1, 2],
      [3, 2, 1],
    ],
  );
});

test("an order arranged and not confirmed outlives a reload, and another device's order", () => {
  const { ask, store } = openPage();
  /** @type {RankingAnswer} */ (ask(ORDER)).move(2, 0);

  const next = openPage(store);
  /** @type {RankingAnswer} */
  const order = next.ask(ORDER, [2, 1, 3]);
  assert.deepEqual([order.order, order.confirmed, order.status], [[3, 1, 2], false, UNCONFIRMED]);
  order.take([2, 1, 3]);
  assert.deepEqual(order.order, [3, 1, 2]);

  order.confirm();
  order.take([2, 1, 3]);
  assert.deepEqual(order.order, [2, 1, 3]);
});

test("going on marks what is still open, and answering takes the marks back", () => {
  const { ask, given } = openPage();
  /** @type {ScaleAnswer} */
  const sharpness = ask(SHARPNESS);
  /** @type {TextAnswer} */
  const remarks = ask(REMARKS);
  /** @type {ItemsAnswer} */
  const usability = ask(USABILITY, [1, 1, 0, 1, 1, 1, 1, 1, 0, 1]);
  const questionnaire = new Questionnaire([sharpness, remarks, usability]);
  remarks.write("Not given yet");

  assert.deepEqual(questionnaire.check(), [sharpness, usability], "an optional question is never open");
  assert.deepEqual(given, [{ question: "remarks", value: "Not given yet", part: null }]);
  assert.equal(sharpness.status, "Not answered yet");
  const open = usability.wantedParts.flatMap((wanted, item) => (wanted ? [item] : []));
  assert.deepEqual(open, [2, 8]);

  sharpness.choose(4);
  usability.choose(2, 3);
  assert.equal(questionnaire.marked, true);
  usability.choose(8, 3);
  assert.equal(questionnaire.marked, false);
  assert.deepEqual(questionnaire.check(), []);
});

const SCALES = ["Mental demands", "Physical demands", "Temporal demands"].map((title) => ({
  name: title.toLowerCase().replace(" ", "-"),
  title,
  text: `${title}?`,
  low: "Low",
  high: "High",
}));
/** @type {Api.Question} */
const WORKLOAD = {
  id: "workload",
  kind: "surg-tlx",
  text: "Your workload",
  scales: SCALES,
  pairs: [
    { first: 0, second: 1 },
    { first: 0, second: 2 },
    { first: 1, second: 2 },
  ],
};
/** @type {Api.Question} */
const EFFORT = { id: "effort", kind: "visual-analogue", text: "Effort?", low: "None", high: "All" };
/** @type {Api.Question} */
const SHARED = { id: "shared", kind: "ranking", text: "Which was best?", ties: true };

test("each scale and each pair of a workload index is given alone, and all make an answer", () => {
  const { ask, given } = openPage();
  /** @type {ItemsAnswer} */
  const workload = ask(WORKLOAD);
  assert.deepEqual(workload.points, [0, 0, 0, 0, 0, 0], "nothing is marked before the surgeon marks it");

  workload.choose(1, 21);
  workload.choose(4, 2);
  assert.deepEqual(given, [
    { question: "workload", value: [0, 21, 0, 0, 0, 0], part: 1 },
    { question: "workload", value: [0, 0, 0, 0, 2, 0], part: 4 },
  ]);
  workload.show("saved");
  assert.deepEqual([workload.status, workload.unanswered], ["2 of 6 answered · Saved", true]);
  workload.want();
  assert.deepEqual(workload.wantedParts, [true, false, true, true, false, true]);

  workload.take([1, 21, 3, 1, 2, 1]);
  assert.equal(workload.unanswered, false);
});

test("a workload index half filled before a reload goes on where it was", () => {
  const { ask } = openPage();
  /** @type {ItemsAnswer} */
  const workload = ask(WORKLOAD, [0, 21, 0, 0, 2, 0]);
  assert.deepEqual([workload.points, workload.status], [[0, 21, 0, 0, 2, 0], "2 of 6 answered · Saved"]);
});

test("the lower end of a line is an answer, and a line that was not touched is none", () => {
  const { ask, given } = openPage();
  /** @type {ScaleAnswer} */
  const effort = ask(EFFORT);
  assert.deepEqual([effort.point, effort.unanswered], [null, true]);
  effort.choose(0);
  assert.deepEqual(given, [{ question: "effort", value: 0, part: null }]);
  assert.equal(effort.unanswered, false);
  /** @type {ScaleAnswer} */
  const again = ask(EFFORT, 0);
  assert.deepEqual([again.point, again.status], [0, "Saved"]);
});

test("settings may share a place where the protocol allows it", () => {
  const { ask, given } = openPage();
  /** @type {ItemsAnswer} */
  const shared = ask(SHARED);
  for (const setting of [0, 1, 2]) shared.choose(setting, 1);
  assert.deepEqual(
    given.map(({ value }) => value),
    [
      [1, 0, 0],
      [0, 1, 0],
      [0, 0, 1],
    ],
  );
  shared.show("saved");
  assert.equal(shared.unanswered, false);
});

test("no setting gains from the starting order of a ranking, which is the same on every device", () => {
  assert.deepEqual(drawnOrder(6, "session/order"), drawnOrder(6, "session/order"));
  const first = Array.from({ length: 6 }, () => 0);
  for (let session = 0; session < 6000; session += 1) {
    const order = drawnOrder(6, `f3b1-${session}/order`);
    assert.deepEqual(
      [...order].sort((a, b) => a - b),
      [1, 2, 3, 4, 5, 6],
    );
    const best = (order[0] ?? 0) - 1;
    first[best] = (first[best] ?? 0) + 1;
  }
  // 1000 each, with a standard deviation of 29.
  assert.ok(
    first.every((count) => count > 850 && count < 1150),
    String(first),
  );
});

test("a ranking recalls what was said of each setting", () => {
  /** @type {RankingAnswer} */
  const order = openPage().ask(ORDER);
  assert.deepEqual(
    [1, 2, 3].map((setting) => order.saidOf(setting)),
    ["“Blurred”", "", "“Sharp” “It wanders”"],
  );
});

test("a setting that is dragged takes the place of those above which it comes to stand", () => {
  const middles = [100, 200, 300, 400];
  assert.equal(placeAt(middles, 3, 40), 0);
  assert.equal(placeAt(middles, 3, 310), 3);
  assert.equal(placeAt(middles, 0, 260), 1);
  assert.equal(placeAt(middles, 1, 200), 1);
});

test("long questionnaires say how far one is", () => {
  const { ask } = openPage();
  const usability = ask(USABILITY, [1, 1, 0, 1, 1, 1, 1, 1, 0, 1]);
  assert.equal(new Questionnaire([usability, ask(SHARPNESS, 4)]).progressWords, "9 of 11 answered");
  assert.equal(new Questionnaire([ask(SHARPNESS)]).progressWords, "", "one question is seen at a glance");
});

test("what gave a setting away is asked only of who recognised one, and counts as no open question before", () => {
  const { ask, given } = openPage();
  /** @type {Api.Question} */
  const recognised = { id: "seen", kind: "recognition", text: "Recognised?" };
  /** @type {Api.Question} */
  const why = { id: "seen-why", kind: "text", text: "By what?", optional: true, only_if_yes: "seen" };
  /** @type {ScaleAnswer} */
  const guess = ask(recognised);
  const words = ask(why);
  const asked = new Questionnaire([guess, words, ask(SHARPNESS), ask(REMARKS)]);

  assert.equal(asked.isAsked(words), false);
  assert.equal(asked.progressWords, "0 of 3 answered");
  guess.choose(2);
  assert.equal(asked.isAsked(words), false);
  guess.choose(3);
  assert.equal(asked.isAsked(words), true);
  assert.equal(asked.progressWords, "1 of 4 answered");
  assert.deepEqual(
    given.map(({ value }) => value),
    [2, 3],
  );
});
