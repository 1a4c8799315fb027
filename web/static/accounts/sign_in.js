// The page to sign in.

import { inWords, post } from "../shared/api.js";
import { byId, setText } from "../shared/dom.js";

const form = byId("sign-in-form", HTMLFormElement);
const go = byId("sign-in-go", HTMLButtonElement);
const passphrase = byId("passphrase", HTMLInputElement);

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  go.disabled = true;
  setText(byId("sign-in-trouble"), "");
  try {
    const name = byId("name", HTMLInputElement).value.trim();
    const { home } = await post("/api/sign-in", { name, passphrase: passphrase.value });
    location.assign(form.dataset.next || home);
  } catch (error) {
    setText(byId("sign-in-trouble"), inWords(error));
    passphrase.select();
  } finally {
    go.disabled = false;
  }
});
