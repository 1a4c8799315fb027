// The page of a tablet whose link is no longer valid. What the tablet still holds is sent nevertheless.

import { byId, setText } from "../shared/dom.js";
import { counted } from "../shared/text.js";
import { lastView, openOutbox, openVoiceOutbox } from "./device.js";
import { forgetPage } from "./offline.js";

const outbox = openOutbox();
const voice = openVoiceOutbox();
let began = outbox.waiting.length;

function draw() {
  const left = outbox.waiting.length + voice.waiting;
  began = Math.max(began, left);
  const held = counted(left, "comment or answer is", "comments and answers are");
  if (left > 0) setText(byId("held"), `${held} still on this tablet. Sending…`);
  else if (began > 0) setText(byId("held"), "Everything on this tablet has been saved.");
}

// The next person to hold the tablet must not see the state of this session.
lastView.forget();
forgetPage();

outbox.subscribe(draw);
voice.subscribe(draw);
draw();
