// The page that a tablet opens once. It tries what a trial needs of the tablet, says what works, and tells the server,
// so that the operator sees it.

import { post } from "../shared/api.js";
import { byId, make, setText } from "../shared/dom.js";
import { storeOn } from "../shared/storage.js";
import { tellTrouble } from "../shared/trouble.js";
import { device } from "./device.js";
import { tryAll } from "./trials.js";
import { PARTS, summary } from "./words.js";

const store = storeOn(() => localStorage);

/** @param {import("./words.js").Tried[]} tried */
function draw(tried) {
  const lines = tried.map(({ part, works }) =>
    make(
      "li",
      {},
      make("strong", {}, works ? "✓ " : "✗ "),
      `${PARTS[part].name}: ${works ? "works" : PARTS[part].advice}`,
    ),
  );
  byId("tried").replaceChildren(...lines);
  setText(byId("verdict"), summary(tried));
}

const go = byId("go", HTMLButtonElement);
go.onclick = async () => {
  go.disabled = true;
  setText(byId("verdict"), "Trying…");
  // In the tap itself: later a browser would not ask for the microphone, nor let sound be measured.
  const tried = await tryAll(store);
  draw(tried);
  try {
    await post("/api/surgeon/tablet-trials", { device: device(store), tried });
    setText(byId("result"), "The operator’s page shows it, too, in the card “Ready for a trial?”.");
  } catch (error) {
    tellTrouble(
      byId("result"),
      error,
      "The server did not answer, so the operator does not know it yet. Try again.",
    );
  }
  go.disabled = false;
};
