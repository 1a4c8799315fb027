// The backup of the database: started here, made by the server, and downloaded here.

import { get, post } from "../shared/api.js";
import { byId, setText } from "../shared/dom.js";
import { tell, tellTrouble } from "../shared/trouble.js";
import { followUntilMade } from "../shared/until_made.js";

const PATH = "/api/researcher/backup";

/**
 * A size for people.
 *
 * @param {number} bytes
 */
function sizeWords(bytes) {
  const megabytes = bytes / 1e6;
  return megabytes < 1 ? `${Math.ceil(bytes / 1e3)} kB` : `${megabytes.toFixed(1)} MB`;
}

/** Shows the state of the backup, and starts one when the form is sent. */
export function offerBackup() {
  const trouble = byId("backup-trouble");
  const go = byId("backup-go", HTMLButtonElement);
  const passphrase = byId("backup-passphrase", HTMLInputElement);

  byId("backup", HTMLFormElement).addEventListener("submit", async (event) => {
    event.preventDefault();
    go.disabled = true;
    try {
      follow(await post(PATH, { passphrase: passphrase.value }));
      passphrase.value = "";
    } catch (error) {
      go.disabled = false;
      tellTrouble(trouble, error);
    }
  });

  /** @param {Api.BackupState} now */
  function show(now) {
    const isRunning = now.state === "running";
    go.disabled = isRunning;
    byId("backup-download").hidden = now.state !== "ready";
    tell(trouble, now.state === "failed" ? `No backup was made: ${now.reason}.` : "");
    setText(byId("backup-state"), words(now));
  }

  const follow = followUntilMade(() => get(PATH), show, trouble);
}

/** @param {Api.BackupState} now */
function words(now) {
  switch (now.state) {
    case "running":
      return "The backup is being made and verified.";
    case "ready":
      return `The backup is ready: ${sizeWords(now.bytes)}, chain ${now.head}. It is kept for 15 minutes.`;
    default:
      return "";
  }
}
