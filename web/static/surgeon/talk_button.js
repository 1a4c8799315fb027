// The button that is held to talk, and the keys that do the same.

import { byId, setText } from "../shared/dom.js";
import { followHeld } from "../shared/held_button.js";
import { say } from "../shared/language.js";
import { Grip } from "./grip.js";
import { whyNoMicrophone } from "./microphone.js";
import { focusOn, isTalkKey } from "./talk_keys.js";
import { isEnded } from "./words.js";

/**
 * Draws the state of `talk`, and passes presses on to it.
 *
 * @param {import("./talk.js").Talk} talk
 * @param {import("./voice_outbox.js").VoiceOutbox} outbox
 * @param {boolean} allowed whether the page may ask for the microphone
 */
export function talkButton(talk, outbox, allowed) {
  const button = byId("talk", HTMLButtonElement);
  const meter = byId("talk-level");
  const why = () => whyNoMicrophone(allowed);
  const grip = new Grip(talk);
  let open = false;
  let drawing = 0;

  /** @param {Api.SurgeonView | null} state */
  function follow(state) {
    open = (state?.voice ?? false) && !isEnded(state);
    button.hidden = !open;
    button.disabled = why() !== "";
    setText(byId("voice-why"), open ? why() : "");
    draw();
  }

  function draw() {
    const { state } = talk;
    setText(byId("talk-label"), talk.label);
    button.classList.toggle("recording", state === "recording");
    button.setAttribute("aria-pressed", String(state !== "idle"));
    setText(byId("talk-heard"), state === "recording" ? say("recording") : "");
    setText(byId("voice-trouble"), talk.trouble);
    drawStatus();
    if (state === "recording" && drawing === 0) drawing = requestAnimationFrame(drawLevel);
  }

  function drawLevel() {
    drawing = 0;
    meter.style.transform = `scaleX(${talk.state === "recording" ? talk.level.toFixed(3) : 0})`;
    setText(byId("talk-label"), talk.label);
    if (talk.state === "recording") drawing = requestAnimationFrame(drawLevel);
  }

  function drawStatus() {
    const { kind, text } = outbox.status;
    const status = byId("voice-state");
    // A piece is sent every second, so the text would flicker.
    const speaking = talk.state === "recording" && kind !== "unsaved" && outbox.heldUp === 0;
    setText(status, speaking ? say("saved-as-you-speak") : text);
    status.classList.toggle("saved", kind === "saved" && !speaking);
    status.classList.toggle("unsaved", kind === "unsaved");
  }

  followHeld(button, {
    isOpen: () => open,
    isKey: (key) => isTalkKey(key, focusOn(document.activeElement)),
    press: (by) => {
      if (why() === "") grip.press(by);
    },
    release: (by) => grip.release(by),
    leave: () => grip.leave(),
  });
  outbox.subscribe(drawStatus);
  return { follow, draw };
}
