// The page of a tablet whose link is no longer valid. What the tablet still holds is sent nevertheless.

import { byId, setText } from "../shared/dom.js";
import { say } from "../shared/language.js";
import { sendLeftAnswers } from "./answers.js";
import { Comments } from "./comments.js";
import { drafts, lastView, openHolding, openOutbox, openVoiceOutbox } from "./device.js";
import { keepLanguage } from "./languages.js";
import { forgetPage } from "./offline.js";

keepLanguage();
const outbox = openOutbox();
const voice = openVoiceOutbox();
let began = 0;

function draw() {
  const left = outbox.waiting.length + voice.waiting;
  const refused = outbox.refused().length + voice.refused();
  began = Math.max(began, left);
  if (left > 0) setText(byId("held"), say("over-held", { count: left }));
  else if (refused > 0) setText(byId("held"), say("kept-refused", { count: refused }));
  else if (began > 0) setText(byId("held"), say("over-saved"));
}

outbox.subscribe(draw);
voice.subscribe(draw);

// What was half written is sent as it is: no page comes on which it could be finished.
new Comments(outbox, drafts, () => null, voice).follow(null);
sendLeftAnswers(outbox, drafts, null);

// There is no comment box.
openHolding(outbox, voice, () => false).tellOf(lastView.session);

// The next person to hold the tablet must not see the state of this session.
lastView.forget();
forgetPage();
draw();
