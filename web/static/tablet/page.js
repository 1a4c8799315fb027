// The page that a tablet opens once. It tries what a trial needs of the tablet, says what works, and tells the server,
// so that the operator sees it.

import { post } from "../shared/api.js";
import { byId, make, setText } from "../shared/dom.js";
import { say } from "../shared/language.js";
import { storeOn } from "../shared/storage.js";
import { tellTrouble } from "../shared/trouble.js";
import { uuid } from "../shared/uuid.js";
import { keepLanguage } from "../surgeon/languages.js";
import { Origins } from "../surgeon/origin.js";
import { tryAll } from "./trials.js";
import { partWords, summary } from "./words.js";

keepLanguage();
const store = storeOn(() => localStorage);
/** Names the tablet as the surgeon's page does. */
const origins = new Origins(store, { page: () => performance.now(), wall: () => Date.now() }, uuid);

/** @param {import("./words.js").Tried[]} tried */
function draw(tried) {
  const lines = tried.map(({ part, works }) =>
    make("li", {}, make("strong", {}, works ? "✓ " : "✗ "), partWords(part, works)),
  );
  byId("tried").replaceChildren(...lines);
  setText(byId("verdict"), summary(tried));
}

const go = byId("go", HTMLButtonElement);
go.onclick = async () => {
  go.disabled = true;
  setText(byId("verdict"), say("tablet-trying"));
  // In the tap itself: later a browser would not ask for the microphone, nor let sound be measured.
  const tried = await tryAll(store);
  draw(tried);
  try {
    await post("/api/surgeon/tablet-trials", { device: origins.device(), tried });
    setText(byId("result"), say("tablet-told"));
  } catch (error) {
    tellTrouble(byId("result"), error, say("tablet-not-told"));
  }
  go.disabled = false;
};
