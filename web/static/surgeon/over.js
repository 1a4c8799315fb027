// A tablet whose link opens nothing any more: what it still holds is handed over all the same.

import { byId, setText } from "../shared/dom.js";
import { lastView, openOutbox, openVoiceOutbox } from "./device.js";
import { forgetPage } from "./offline.js";

const outbox = openOutbox();
const voice = openVoiceOutbox();
let began = outbox.waiting.length;

function draw() {
  const left = outbox.waiting.length + voice.waiting;
  began = Math.max(began, left);
  if (left > 0) setText(byId("held"), `This tablet still holds ${left} of what was said. It is being sent.`);
  else if (began > 0) setText(byId("held"), "All that this tablet held has been saved.");
}

// Whoever holds the tablet next is not shown where this session stood.
lastView.forget();
forgetPage();

outbox.subscribe(draw);
voice.subscribe(draw);
draw();
