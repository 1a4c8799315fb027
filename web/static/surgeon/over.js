// The page of a tablet whose link is no longer valid. What the tablet still holds is sent nevertheless.

import { byId, setText } from "../shared/dom.js";
import { say } from "../shared/language.js";
import { lastView, openOutbox, openVoiceOutbox } from "./device.js";
import { speakAsThePage } from "./languages.js";
import { forgetPage } from "./offline.js";

speakAsThePage();
const outbox = openOutbox();
const voice = openVoiceOutbox();
let began = outbox.waiting.length;

function draw() {
  const left = outbox.waiting.length + voice.waiting;
  began = Math.max(began, left);
  if (left > 0) setText(byId("held"), say("over-held", { count: left }));
  else if (began > 0) setText(byId("held"), say("over-saved"));
}

// The next person to hold the tablet must not see the state of this session.
lastView.forget();
forgetPage();

outbox.subscribe(draw);
voice.subscribe(draw);
draw();
