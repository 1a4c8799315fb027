// The page of one study. Every change asks for a reason, and some changes for the passphrase again.

import { get, post } from "../shared/api.js";
import { copyOnPress } from "../shared/copy.js";
import { askConfirmed, askReason } from "../shared/dialogs.js";
import { byId } from "../shared/dom.js";
import "../shared/sign_in.js";
import { tellTrouble } from "../shared/trouble.js";
import { showExport } from "./study_export.js";

const study = byId("study").dataset.study ?? "";

/** @typedef {import("../shared/dialogs.js").Ask} Ask */

/**
 * Makes the change in the name of the person who is signed in, and reloads the page.
 *
 * @param {Api.StudyAction} change
 * @param {string} reason
 * @param {string} [passphrase] entered again for this change
 */
async function make(change, reason, passphrase) {
  const path = "/api/researcher/studies/{study}/changes";
  await post(path, { ...change, reason, passphrase }, { study });
  location.reload();
}

/**
 * Asks for a reason, and makes the change.
 *
 * @param {Ask} ask
 * @param {Api.StudyAction} change
 */
function askAndChange(ask, change) {
  askReason({ ...ask, done: (reason) => make(change, reason) });
}

/**
 * Asks for a reason and the passphrase, and makes the change.
 *
 * @param {Ask} ask
 * @param {Api.StudyAction} change
 */
function confirmAndChange(ask, change) {
  askConfirmed({ ...ask, done: (reason, passphrase) => make(change, reason, passphrase) });
}

function open() {
  const first = document.getElementById("commitment") === null;
  const concerns = document.getElementById("concerns") !== null;
  askAndChange(
    {
      heading: first ? "Draw the orders and open the study" : "Open the study again",
      consequence: first
        ? "The orders of all places are drawn now, once. Then this page shows the line that commits to them. " +
          "Nobody is shown an order."
        : "Sessions can be made in it again. Its orders stay as they were drawn.",
      confirm: concerns ? "Open it although this plan cannot work as it is meant" : undefined,
      go: first ? "Draw and open" : "Open",
    },
    { change: "open", despite_concerns: concerns },
  );
}

function close() {
  askAndChange(
    {
      heading: "Close the study",
      consequence: "No sessions can be made in it until it is opened again.",
      go: "Close",
    },
    { change: "close" },
  );
}

async function lock() {
  const { outstanding } = await get("/api/researcher/studies/{study}", { study });
  const still =
    outstanding === 0
      ? ""
      : ` For ${outstanding} of its sessions a surgeon’s tablet may still hold something.`;
  confirmAndChange(
    {
      heading: "Lock the study",
      consequence:
        "No session can be made any more. What still arrives is kept and marked late, " +
        `but does not count. This cannot be undone.${still}`,
      confirm: outstanding === 0 ? undefined : "Lock anyway",
      go: "Lock",
      danger: true,
    },
    { change: "lock", despite_outstanding: outstanding > 0 },
  );
}

function unblind() {
  confirmAndChange(
    {
      heading: "Unblind the whole study",
      consequence:
        "You and everyone with these pages will see which policy ran in which setting of every session. " +
        "This cannot be undone. The reason stands in every export: name no policy in it.",
      go: "Unblind",
      danger: true,
    },
    { change: "unblind" },
  );
}

/** @param {HTMLButtonElement} button */
function withdraw(button) {
  const { withdraw: session = "", participant = "" } = button.dataset;
  askAndChange(
    {
      heading: `${participant} withdrew`,
      consequence:
        "The plan says what happens to the place. From now on the session’s data stay out of exports.",
      go: "Record the withdrawal",
      danger: true,
    },
    { change: "withdraw", session },
  );
}

/** @type {Record<string, () => void | Promise<void>>} */
const actions = { open, close, lock, unblind };
for (const [id, action] of Object.entries(actions)) {
  // The page has only those buttons that fit the study's state.
  document.getElementById(id)?.addEventListener("click", async () => {
    try {
      await action();
    } catch (error) {
      tellTrouble(byId("study-trouble"), error);
    }
  });
}
for (const button of document.querySelectorAll("button")) {
  if (button.dataset.withdraw) button.addEventListener("click", () => withdraw(button));
}

const copy = document.getElementById("copy-commitment");
if (copy instanceof HTMLButtonElement) copyOnPress(copy, byId("commitment"));

// A study without a session has nothing to export.
if (document.getElementById("export")) showExport(study);
