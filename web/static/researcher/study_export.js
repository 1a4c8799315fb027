// The study's export. It is started here, made by the server, and downloaded here.

import { get, post } from "../shared/api.js";
import { byId, setText } from "../shared/dom.js";
import { tell, tellTrouble } from "../shared/trouble.js";
import { followUntilMade } from "../shared/until_made.js";
import { failedWords, progressShare, progressWords, readyWords } from "./study_export_words.js";

const PATH = "/api/researcher/studies/{study}/export";

/**
 * Shows the state of the export of `study`, and starts an export when a button is pressed.
 *
 * @param {string} study
 */
export function showExport(study) {
  const trouble = byId("export-trouble");
  const buttons = [byId("export-blinded", HTMLButtonElement)];
  const unblinded = document.getElementById("export-unblinded");
  if (unblinded instanceof HTMLButtonElement) buttons.push(unblinded);

  for (const button of buttons) {
    button.addEventListener("click", async () => {
      for (const each of buttons) each.disabled = true;
      try {
        follow(await post(PATH, { unblinded: button === unblinded }, { study }));
      } catch (error) {
        for (const each of buttons) each.disabled = false;
        tellTrouble(trouble, error);
      }
    });
  }

  /** @param {Api.StudyExportState} now */
  function show(now) {
    const isRunning = now.state === "running";
    for (const button of buttons) button.disabled = isRunning;
    byId("export-progress").hidden = !isRunning;
    byId("export-ready").hidden = now.state !== "ready";
    setText(byId("export-state"), now.state === "ready" ? readyWords(now) : "");
    tell(trouble, now.state === "failed" ? failedWords(now) : "");

    if (now.state === "running") {
      setText(byId("export-words"), progressWords(now));
      byId("export-bar", HTMLProgressElement).value = progressShare(now.progress);
    }
  }

  const follow = followUntilMade(() => get(PATH, { study }), show, trouble);
}
