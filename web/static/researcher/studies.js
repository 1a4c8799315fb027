// The list of studies, and the form to plan one from its definition.

import { inWords, post } from "../shared/api.js";
import { byId, setText } from "../shared/dom.js";
import "../shared/sign_in.js";
import { Definition, exactText } from "./definition.js";

const file = byId("file", HTMLInputElement);
const shown = byId("definition", HTMLTextAreaElement);
const definition = new Definition();
const go = byId("plan-go", HTMLButtonElement);

/** The sites that were named. An empty list means all sites. */
function sites() {
  const named = byId("sites", HTMLInputElement).value.split(",");
  return named.map((site) => site.trim()).filter((site) => site !== "");
}

// Browsers report no change when the same file is chosen again, as after it was corrected.
file.addEventListener("click", () => {
  file.value = "";
});
file.addEventListener("change", async () => {
  const chosen = file.files?.[0];
  if (!chosen) return;
  setText(byId("plan-trouble"), "");
  try {
    const text = exactText(await chosen.arrayBuffer());
    shown.value = text;
    definition.take(text, shown.value);
  } catch {
    setText(
      byId("plan-trouble"),
      `${chosen.name} is not a text in UTF-8: save it as UTF-8 and choose it again.`,
    );
  }
});

document.getElementById("template")?.addEventListener("click", (event) => {
  const button = /** @type {HTMLButtonElement} */ (event.currentTarget);
  shown.value = button.dataset.template ?? "";
  shown.focus();
});

byId("plan", HTMLFormElement).addEventListener("submit", async (event) => {
  event.preventDefault();
  go.disabled = true;
  try {
    const { study } = await post("/api/researcher/studies", {
      definition: definition.toSend(shown.value),
      sites: sites(),
      reason: byId("plan-reason", HTMLInputElement).value.trim(),
    });
    location.assign(`/researcher/studies/${study}`);
  } catch (error) {
    setText(byId("plan-trouble"), inWords(error));
  } finally {
    go.disabled = false;
  }
});
