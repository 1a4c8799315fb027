// Dialogs that ask for something. If the action fails, the dialog stays open and shows why.

import { inWords } from "./api.js";
import { byId, setText } from "./dom.js";

/**
 * @typedef {object} Ask
 * @property {string} heading
 * @property {string} consequence what will happen
 * @property {string} go the button's label
 * @property {boolean} [danger]
 * @property {string} [confirm] a statement that has to be ticked too
 */

/** Whether a dialog is open. A question that had to wait for the server must not take its place. */
export function isAsking() {
  return document.querySelector("dialog[open]") !== null;
}

/**
 * Opens `dialog`. On submit it awaits `done()`, and closes if that succeeds. If it fails, `trouble` shows why. If the
 * dialog was cancelled meanwhile and asks for something else by then, the answer leaves it as it is.
 *
 * @param {HTMLDialogElement} dialog
 * @param {HTMLElement} trouble
 * @param {() => Promise<void>} done
 */
export function askIn(dialog, trouble, done) {
  const form = dialog.querySelector("form");
  const submit = /** @type {HTMLButtonElement | null} */ (dialog.querySelector("[type=submit]"));
  if (!form || !submit) throw new Error(`#${dialog.id} has no form to submit`);

  setText(trouble, "");
  for (const button of dialog.querySelectorAll("button")) {
    if (button.dataset.close !== undefined) button.onclick = () => dialog.close();
  }

  const send = async (/** @type {SubmitEvent} */ event) => {
    event.preventDefault();
    submit.disabled = true;
    let failed = null;
    try {
      await done();
    } catch (error) {
      failed = inWords(error);
    }
    if (form.onsubmit !== send) return;

    submit.disabled = false;
    if (failed === null) {
      dialog.close();
      form.reset();
    } else setText(trouble, failed);
  };

  form.onsubmit = send;
  submit.disabled = false;
  dialog.showModal();
}

/**
 * Asks the person to confirm something.
 *
 * @param {Ask & { done: () => Promise<void> }} ask
 */
export function askWhetherMeant(ask) {
  openReasonDialog(ask, false);
}

/**
 * Asks for a reason.
 *
 * @param {Ask & { done: (reason: string) => Promise<void> }} ask
 */
export function askReason(ask) {
  openReasonDialog(ask, true);
}

/**
 * Asks for a reason, and once more for the passphrase of the person who is signed in.
 *
 * @param {Ask & { done: (reason: string, passphrase: string) => Promise<void> }} ask
 */
export function askConfirmed(ask) {
  openReasonDialog(ask, true, true);
}

/**
 * @param {Ask & { done: (reason: string, passphrase: string) => Promise<void> }} ask
 * @param {boolean} reasoned whether a reason has to be given
 * @param {boolean} [confirmed] whether the passphrase has to be given
 */
function openReasonDialog(ask, reasoned, confirmed = false) {
  if (isAsking()) return;
  setText(byId("reason-heading"), ask.heading);
  setText(byId("reason-consequence"), ask.consequence);

  const go = byId("reason-go", HTMLButtonElement);
  setText(go, ask.go);
  go.className = ask.danger ? "danger filled" : "primary";

  const reason = byId("reason", HTMLInputElement);
  byId("reason-field").hidden = !reasoned;
  reason.required = reasoned;
  reason.value = "";

  const passphrase = byId("passphrase", HTMLInputElement);
  byId("passphrase-field").hidden = !confirmed;
  passphrase.required = confirmed;
  passphrase.value = "";

  byId("reason-confirm").hidden = !ask.confirm;
  setText(byId("reason-confirm-text"), ask.confirm ?? "");
  const meant = byId("reason-confirmed", HTMLInputElement);
  meant.required = Boolean(ask.confirm);
  meant.checked = false;

  askIn(byId("reason-dialog", HTMLDialogElement), byId("reason-trouble"), () =>
    ask.done(reason.value.trim(), passphrase.value),
  );
}
