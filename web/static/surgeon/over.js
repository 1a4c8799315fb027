// A tablet whose link opens nothing any more: what it still holds is handed over all the same.

import { byId, setText } from "../shared/dom.js";
import { openOutbox } from "./device.js";

const outbox = openOutbox();
const began = outbox.waiting.length;

function draw() {
  const left = outbox.waiting.length;
  if (left > 0) setText(byId("held"), `This tablet still holds ${left} of what was said. It is being sent.`);
  else if (began > 0) setText(byId("held"), "All that this tablet held has been saved.");
}

outbox.subscribe(draw);
draw();
