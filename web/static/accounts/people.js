// The leads' page for creating and changing accounts. Each change needs the lead's passphrase again.

import { inWords, post } from "../shared/api.js";
import { askIn } from "../shared/dialogs.js";
import { byId, setText } from "../shared/dom.js";
import "../shared/sign_in.js";
import { offerBackup } from "./backup.js";

const role = byId("change-role", HTMLSelectElement);
const first = byId("change-first", HTMLInputElement);

/** @typedef {{ account: string, display: string, role: string }} Person */
/** @typedef {Api.AccountAction["change"]} Change */
/** @typedef {{ heading: string, consequence: string, go: string, danger?: boolean }} Words */

/**
 * The texts of the dialog before each change.
 *
 * @type {Record<Change, (person: Person) => Words>}
 */
const words = {
  role: ({ display }) => ({
    heading: `Change the role of ${display}`,
    consequence: "It takes effect with the next request, even if the person is signed in now.",
    go: "Change the role",
  }),
  passphrase: ({ display }) => ({
    heading: `Set a new passphrase for ${display}`,
    consequence:
      "All sign-ins of the account end. At the next one the person has to choose a passphrase that only they know.",
    go: "Set the passphrase",
  }),
  "sign-out": ({ display }) => ({
    heading: `Sign ${display} out`,
    consequence: "All sign-ins of the account end, on every device. The person can sign in again.",
    go: "Sign out everywhere",
  }),
  disable: ({ display }) => ({
    heading: `Disable the account of ${display}`,
    consequence:
      "All its sign-ins end and it cannot sign in any more. Its records stay. It can be enabled again.",
    go: "Disable",
    danger: true,
  }),
  enable: ({ display }) => ({
    heading: `Enable the account of ${display}`,
    consequence: "The person can sign in again, with the passphrase as before.",
    go: "Enable",
  }),
};

/**
 * The change in the form that the server expects.
 *
 * @param {Change} change
 * @returns {Api.AccountAction}
 */
function wanted(change) {
  switch (change) {
    case "role":
      return { change, role: /** @type {Api.AccountRole} */ (role.value) };
    case "passphrase":
      return { change, first_passphrase: first.value };
    default:
      return { change };
  }
}

/**
 * @param {Change} change
 * @param {Person} person
 */
function ask(change, person) {
  const { heading, consequence, go, danger } = words[change](person);
  setText(byId("change-heading"), heading);
  setText(byId("change-consequence"), consequence);

  const button = byId("change-go", HTMLButtonElement);
  setText(button, go);
  button.className = danger ? "danger filled" : "primary";

  byId("change-role-field").hidden = change !== "role";
  role.value = person.role;
  byId("change-first-field").hidden = change !== "passphrase";
  first.required = change === "passphrase";
  first.value = "";
  const passphrase = byId("change-passphrase", HTMLInputElement);
  passphrase.value = "";

  askIn(byId("change-dialog", HTMLDialogElement), byId("change-trouble"), async () => {
    const path = "/api/researcher/accounts/{account}/changes";
    await post(path, { ...wanted(change), passphrase: passphrase.value }, { account: person.account });
    location.reload();
  });
}

for (const row of document.querySelectorAll("#people tbody tr")) {
  const { account = "", display = "", role = "" } = /** @type {HTMLElement} */ (row).dataset;
  for (const button of row.querySelectorAll("button")) {
    button.onclick = () => ask(/** @type {Change} */ (button.dataset.change), { account, display, role });
  }
}

offerBackup();

const go = byId("make-go", HTMLButtonElement);
byId("make", HTMLFormElement).addEventListener("submit", async (event) => {
  event.preventDefault();
  go.disabled = true;
  try {
    await post("/api/researcher/accounts", {
      account: byId("account", HTMLInputElement).value.trim(),
      display: byId("display", HTMLInputElement).value.trim(),
      role: /** @type {Api.AccountRole} */ (byId("role", HTMLSelectElement).value),
      first_passphrase: byId("first", HTMLInputElement).value,
      passphrase: byId("make-passphrase", HTMLInputElement).value,
    });
    location.reload();
  } catch (error) {
    setText(byId("make-trouble"), inWords(error));
  } finally {
    go.disabled = false;
  }
});
