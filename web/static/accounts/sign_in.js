// The sign-in page.

import { inWords, post, Refused } from "../shared/api.js";
import { byId, setText } from "../shared/dom.js";

const form = byId("sign-in-form", HTMLFormElement);
const go = byId("sign-in-go", HTMLButtonElement);
const passphrase = byId("passphrase", HTMLInputElement);
const change = byId("change", HTMLDetailsElement);
const chosen = byId("new-passphrase", HTMLInputElement);
const again = byId("new-again", HTMLInputElement);
const trouble = byId("sign-in-trouble");

/** The server's status if a lead set the passphrase and the person has to choose another. */
const CHOOSE_ANOTHER = 409;

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  if (change.open && chosen.value !== again.value) {
    setText(trouble, "The two new passphrases differ. Type both again.");
    chosen.select();
    return;
  }

  go.disabled = true;
  setText(trouble, "");
  try {
    const name = byId("name", HTMLInputElement).value.trim();
    const new_passphrase = change.open && chosen.value !== "" ? chosen.value : undefined;
    const { home } = await post("/api/sign-in", { name, passphrase: passphrase.value, new_passphrase });
    location.assign(form.dataset.next || home);
  } catch (error) {
    if (error instanceof Refused && error.status === CHOOSE_ANOTHER) {
      change.open = true;
      setText(trouble, "A lead set this passphrase. Choose one that only you know, and type it twice.");
      chosen.focus();
    } else {
      setText(trouble, inWords(error));
      passphrase.select();
    }
  } finally {
    go.disabled = false;
  }
});
