// The dialog that records a participant's consent.

import { askIn } from "../shared/dialogs.js";
import { byId } from "../shared/dom.js";

/** Today's date by this device's clock, in the format of a date field. */
function today() {
  const now = new Date();
  const pad = (/** @type {number} */ number) => String(number).padStart(2, "0");
  return `${now.getFullYear()}-${pad(now.getMonth() + 1)}-${pad(now.getDate())}`;
}

/**
 * Opens the dialog, and calls `done` with the consent that was entered.
 *
 * @param {Api.OperatorView} view
 * @param {(consent: Api.NewConsent) => Promise<void>} done
 */
export function askConsent({ session, consent_required: required }, done) {
  const version = byId("consent-version", HTMLInputElement);
  const given = byId("consent-date", HTMLInputElement);
  const by = byId("consent-by", HTMLInputElement);
  const medium = byId("consent-medium", HTMLSelectElement);
  version.value = required ?? "";
  version.readOnly = required != null;
  given.value = today();
  by.value = "";

  askIn(byId("consent-dialog", HTMLDialogElement), byId("consent-trouble"), () =>
    done({
      session,
      text_version: version.value.trim(),
      given_on: given.value,
      obtained_by: by.value.trim(),
      medium: medium.value === "screen" ? "screen" : "paper",
    }),
  );
}
