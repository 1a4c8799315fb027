// Native dialogs that ask for something and stay open, with the reason, until it has been done.

import { inWords } from "./api.js";
import { setText } from "./dom.js";

/**
 * Opens `dialog`; on submit awaits `done()`, and closes if it worked. `trouble` is where a refusal is told.
 */
export function askIn(dialog, trouble, done) {
  const form = dialog.querySelector("form");
  const submit = form.querySelector("[type=submit]");
  setText(trouble, "");
  for (const button of dialog.querySelectorAll("[data-close]")) button.onclick = () => dialog.close();
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

/** Asks in the page's reason dialog whether something is meant. `ask` is `{ heading, consequence, go, done() }`. */
export function askWhetherMeant(ask) {
  open({ ...ask, unreasoned: true });
}

/**
 * Asks for a reason in the page's reason dialog. `ask` is `{ heading, consequence, go, danger, confirm, done(reason) }`; where
 * there is a `confirm`, its box has to be ticked too.
 */
export function askReason(ask) {
  open(ask);
}

function open(ask) {
  const dialog = document.getElementById("reason-dialog");
  const go = document.getElementById("reason-go");
  setText(document.getElementById("reason-heading"), ask.heading);
  setText(document.getElementById("reason-consequence"), ask.consequence);
  setText(go, ask.go);
  go.className = ask.danger ? "danger filled" : "primary";
  const reason = document.getElementById("reason");
  document.getElementById("reason-field").hidden = ask.unreasoned ?? false;
  reason.required = !ask.unreasoned;
  reason.value = "";
  const confirm = document.getElementById("reason-confirm");
  confirm.hidden = !ask.confirm;
  setText(confirm.querySelector("span"), ask.confirm ?? "");
  const confirmed = document.getElementById("reason-confirmed");
  confirmed.required = Boolean(ask.confirm);
  confirmed.checked = false;
  askIn(dialog, document.getElementById("reason-trouble"), () => ask.done(reason.value.trim()));
}
