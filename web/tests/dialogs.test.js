// The dialogs that ask for something, and answers that come late.

import assert from "node:assert/strict";
import { test } from "node:test";

import { Refused } from "../static/shared/api.js";
import { askIn } from "../static/shared/dialogs.js";
import { settle } from "./around.js";

/** A dialog with a form and its button to send it, as far as `askIn` uses them. */
function fakeDialog() {
  const submit = { disabled: false };
  const form = {
    /** @type {((event: object) => void) | null} */
    onsubmit: null,
    resets: 0,
    reset() {
      this.resets += 1;
    },
  };
  return {
    id: "fake",
    open: false,
    form,
    submit,
    querySelector: (/** @type {string} */ name) => (name === "form" ? form : submit),
    querySelectorAll: () => [],
    showModal() {
      this.open = true;
    },
    close() {
      this.open = false;
    },
    send() {
      form.onsubmit?.({ preventDefault() {} });
    },
  };
}

/** A request whose answer the test gives. */
function request() {
  let succeed = () => {};
  /** @type {(error: Error) => void} */
  let fail = () => {};
  /** @type {Promise<void>} */
  const answer = new Promise((resolve, reject) => {
    succeed = resolve;
    fail = reject;
  });
  return { answer, succeed: () => succeed(), fail: (/** @type {Error} */ error) => fail(error) };
}

/**
 * @param {ReturnType<typeof fakeDialog>} dialog
 * @param {{ textContent: string }} trouble
 * @param {() => Promise<void>} done
 */
function ask(dialog, trouble, done) {
  askIn(/** @type {any} */ (dialog), /** @type {any} */ (trouble), done);
}

test("a dialog closes once its action is done, and stays with the reason if it is refused", async () => {
  const dialog = fakeDialog();
  const trouble = { textContent: "" };
  const refused = request();
  const done = request();
  const answers = [refused.answer, done.answer];
  ask(dialog, trouble, () => answers.shift() ?? Promise.resolve());

  dialog.send();
  assert.ok(dialog.submit.disabled, "sent once");
  refused.fail(new Refused(409, "The study is closed.", true));
  await settle();
  assert.deepEqual([dialog.open, trouble.textContent], [true, "The study is closed."]);
  assert.ok(!dialog.submit.disabled);

  dialog.send();
  done.succeed();
  await settle();
  assert.deepEqual([dialog.open, dialog.form.resets], [false, 1]);
});

test("a late answer leaves a dialog alone that asks for something else by then", async () => {
  for (const isDone of [true, false]) {
    const dialog = fakeDialog();
    const trouble = { textContent: "" };
    const slow = request();
    ask(dialog, trouble, () => slow.answer);
    dialog.send();
    dialog.close();

    ask(dialog, trouble, () => Promise.resolve());
    assert.ok(!dialog.submit.disabled, "the next question can be answered at once");
    if (isDone) slow.succeed();
    else slow.fail(new Refused(409, "The study is closed.", true));
    await settle();
    assert.deepEqual([dialog.open, dialog.form.resets, trouble.textContent], [true, 0, ""]);
  }
});
