// Dialogs that ask for something. They stay open, and say why, until it has been done.

import { inWords } from "./api.js";
import { byId, make, setText } from "./dom.js";

/**
 * @typedef {object} Ask
 * @property {string} heading
 * @property {string} consequence what will happen
 * @property {string} go the button's label
 * @property {boolean} [danger]
 * @property {string} [confirm] a statement that has to be ticked too
 */

/**
 * Opens `dialog`. On submit it awaits `done()`, and closes if that worked; `trouble` shows why it
 * did not.
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

  form.onsubmit = async (event) => {
    event.preventDefault();
    submit.disabled = true;
    try {
      await done();
      dialog.close();
      form.reset();
    } catch (error) {
      setText(trouble, inWords(error));
    } finally {
      submit.disabled = false;
    }
  };
  dialog.showModal();
}

/**
 * Asks whether something is meant.
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
 * Asks for a reason and for who gives it.
 *
 * @param {Ask & { people?: string[], done: (reason: string, person: string) => Promise<void> }} ask `people`: names to
 *   choose from
 */
export function askSigned(ask) {
  openReasonDialog(ask, true, ask.people ?? []);
}

/**
 * @param {Ask & { done: (reason: string, person: string) => Promise<void> }} ask
 * @param {boolean} reasoned whether a reason has to be given
 * @param {string[]} [people] names to choose from, where a person has to be named
 */
function openReasonDialog(ask, reasoned, people) {
  setText(byId("reason-heading"), ask.heading);
  setText(byId("reason-consequence"), ask.consequence);

  const go = byId("reason-go", HTMLButtonElement);
  setText(go, ask.go);
  go.className = ask.danger ? "danger filled" : "primary";

  const reason = byId("reason", HTMLInputElement);
  byId("reason-field").hidden = !reasoned;
  reason.required = reasoned;
  reason.value = "";

  const person = byId("person", HTMLInputElement);
  byId("person-field").hidden = !people;
  person.required = Boolean(people);
  person.value = "";
  byId("people").replaceChildren(...(people ?? []).map((name) => make("option", { value: name })));

  byId("reason-confirm").hidden = !ask.confirm;
  setText(byId("reason-confirm-text"), ask.confirm ?? "");
  const confirmed = byId("reason-confirmed", HTMLInputElement);
  confirmed.required = Boolean(ask.confirm);
  confirmed.checked = false;

  askIn(byId("reason-dialog", HTMLDialogElement), byId("reason-trouble"), () =>
    ask.done(reason.value.trim(), person.value.trim()),
  );
}
