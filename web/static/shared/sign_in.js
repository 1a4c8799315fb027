// Signing in and out, on every page that can be used under a personal account. When the server asks for it, a dialog
// to sign in opens over the page. Whatever was entered in the page's forms and dialogs stays there. If somebody cancels
// the dialog, it opens again only for what they do, because the page itself asks the server again and again. The top of
// the page then says that one has to sign in.

import { inWords, keep, onSignInNeeded, post } from "./api.js";
import { make, setText } from "./dom.js";
import { serverAnswered, tellTrouble } from "./trouble.js";

/** @type {HTMLDialogElement | null} */
let dialog = null;
/** Whether the dialog has opened and nobody has signed in since. */
let wasShown = false;

/** @param {boolean} isDeed whether somebody wanted to do something */
function askToSignIn(isDeed) {
  tellNeed();
  if (isDeed || !wasShown) showDialog();
}

function showDialog() {
  wasShown = true;
  dialog ??= makeDialog();
  if (!dialog.open) dialog.showModal();
}

/** Says at the top of the page that one has to sign in, until somebody has. */
function tellNeed() {
  if (document.getElementById("sign-in-need")) return;
  document.getElementById("sign-in")?.remove();
  const need = make("span", { id: "sign-in-need", className: "message", role: "status" }, "Sign-in needed");
  const again = make(
    "button",
    { id: "sign-in", className: "small", type: "button", onclick: showDialog },
    "Sign in",
  );
  document.querySelector(".person")?.append(need, " ", again);
}

function makeDialog() {
  const name = make("input", {
    id: "sign-in-name",
    required: true,
    autocomplete: "username",
    autocapitalize: "none",
    spellcheck: false,
  });
  const passphrase = make("input", {
    id: "sign-in-passphrase",
    type: "password",
    required: true,
    autocomplete: "current-password",
  });
  const trouble = make("p", { className: "message", role: "alert" });
  const go = make("button", { className: "primary", type: "submit" }, "Sign in");

  const form = make(
    "form",
    {},
    make("h2", { id: "sign-in-heading" }, "Sign in to continue"),
    make(
      "p",
      { className: "muted" },
      "This belongs to a study. You are not signed in, or your sign-in has ended. Nothing on the page is lost: " +
        "sign in, then repeat what you wanted to do.",
    ),
    make("div", {}, make("label", { for: name.id }, "Name of the account"), name),
    make("div", {}, make("label", { for: passphrase.id }, "Passphrase"), passphrase),
    trouble,
    make(
      "div",
      { className: "actions" },
      make("button", { type: "button", onclick: () => dialog?.close() }, "Cancel"),
      go,
    ),
  );

  form.onsubmit = async (event) => {
    event.preventDefault();
    go.disabled = true;
    try {
      showPerson(await post("/api/sign-in", { name: name.value.trim(), passphrase: passphrase.value }));
      wasShown = false;
      setText(trouble, "");
      passphrase.value = "";
      dialog?.close();
      serverAnswered();
      document.dispatchEvent(new Event("signed-in"));
    } catch (error) {
      setText(trouble, inWords(error));
    } finally {
      go.disabled = false;
    }
  };

  const made = make("dialog", { id: "sign-in-dialog", "aria-labelledby": "sign-in-heading" }, form);
  document.body.append(made);
  return made;
}

onSignInNeeded(askToSignIn);

const link = document.getElementById("sign-in");
if (link instanceof HTMLAnchorElement) link.href = `/sign-in?next=${encodeURIComponent(location.pathname)}`;

async function signOut() {
  try {
    await keep("/api/sign-out", undefined);
    location.reload();
  } catch (error) {
    tellSignedIn(error);
  }
}

/**
 * Says that the sign-out failed. Otherwise somebody could leave a device behind on which they are still signed in.
 *
 * @param {unknown} error
 */
function tellSignedIn(error) {
  const trouble =
    document.getElementById("sign-out-trouble") ??
    make("span", { id: "sign-out-trouble", className: "message", role: "alert" });
  document.querySelector(".person")?.append(" ", trouble);
  tellTrouble(trouble, error, "You are still signed in: no connection to the server. Try again in a moment.");
}

/**
 * Shows who is signed in, as the page's template does.
 *
 * @param {{ display: string, role: string }} person
 */
function showPerson({ display, role }) {
  const name = make("span", {}, `${display} `, make("span", { className: "muted" }, `(${role})`));
  const out = make(
    "button",
    { id: "sign-out", className: "small", type: "button", onclick: signOut },
    "Sign out",
  );
  document.querySelector(".person")?.replaceChildren(name, " ", out);
}

document.getElementById("sign-out")?.addEventListener("click", signOut);
