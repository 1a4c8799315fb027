// The comment box, the quick comments and "Mark this moment".

import { byId, make, setText } from "../shared/dom.js";
import { say, words } from "../shared/language.js";
import { followDrafts } from "./device.js";
import { isKeyboardUp } from "./room.js";

/** A second tap on the same button within this time is ignored. */
const SAME_TAP_MS = 1000;

/** For this long a comment can be taken back. */
const UNDO_MS = 5000;

/** A text longer than this gets a taller box. */
const TALL_LETTERS = 90;

/**
 * Draws `comments`, and passes the surgeon's input on to them.
 *
 * @param {import("./comments.js").Comments} comments
 * @param {import("./outbox.js").Outbox} outbox
 * @param {import("./voice_outbox.js").VoiceOutbox} voice
 */
export function commentBox(comments, outbox, voice) {
  const box = byId("comment", HTMLTextAreaElement);
  const mark = byId("mark", HTMLButtonElement);
  const send = byId("send", HTMLButtonElement);
  const elsewhere = byId("elsewhere");
  const quick = byId("quick");
  const undo = byId("undo", HTMLButtonElement);
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let undoTimer;
  /** Buttons tapped a moment ago. @type {Set<HTMLElement>} */
  const tapped = new Set();
  let quickDrawn = "[]";

  /** @param {Api.SurgeonView | null} state */
  function follow(state) {
    comments.follow(state);
    box.disabled = comments.disabled;
    byId("compose").hidden = comments.disabled && state !== null;
    if (!state) endUndo();
    const looking = state?.phase === "inspecting";
    const invitation = looking ? say("write-what-you-see") : say("write-comment");
    box.placeholder = state ? invitation : say("comments-later");

    mark.hidden = !looking;
    drawQuick(looking ? state.quick_comments : []);
    draw();
  }

  /** @param {string[]} texts */
  function drawQuick(texts) {
    const key = JSON.stringify(texts);
    if (quickDrawn === key) return;
    quickDrawn = key;
    quick.hidden = texts.length === 0;
    quick.replaceChildren(
      ...texts.map((text) => {
        const button = make("button", { type: "button", dir: "auto" }, text);
        button.onclick = () => tap(button, { kind: "quick", text });
        return button;
      }),
    );
  }

  function draw() {
    if (box.value !== comments.text) box.value = comments.text;
    box.classList.toggle("tall", comments.text.length > TALL_LETTERS || comments.text.includes("\n"));
    send.disabled = !comments.unsent;
    send.classList.toggle("primary", comments.unsent);

    const status = byId("comment-state");
    setText(status, comments.status.text);
    status.classList.toggle("saved", comments.status.kind === "saved");
    status.classList.toggle("unsaved", comments.status.kind === "unsaved");
    setText(byId("comment-trouble"), comments.trouble);

    const setting = comments.aboutOtherSetting;
    byId("about").hidden = setting === null;
    if (setting !== null) setText(byId("about"), say("about-setting", { setting }));

    const { offer } = comments;
    elsewhere.hidden = offer === null;
    if (offer) {
      setText(elsewhere, say("continue-draft", { start: words(offer.start) }));
      elsewhere.title = say("begun-elsewhere", { whole: words(offer.whole) });
    }
  }

  /**
   * @param {HTMLElement} button
   * @param {import("./comments.js").Said} what
   */
  function tap(button, what) {
    const entry = tapped.has(button) ? null : comments.say(what);
    if (!entry) return;
    offerUndo(entry);
    tapped.add(button);
    button.classList.add("taken");
    setTimeout(() => {
      tapped.delete(button);
      button.classList.remove("taken");
    }, SAME_TAP_MS);
  }

  function submit() {
    const entry = comments.submit();
    if (!entry) return;
    offerUndo(entry);
    draw();
    // A box that takes the focus by itself would keep a tablet's keyboard up, over the picture.
    if (isKeyboardUp()) box.blur();
    else box.focus();
  }

  /** @param {import("./outbox.js").Entry} entry */
  function offerUndo(entry) {
    clearTimeout(undoTimer);
    undo.hidden = false;
    undo.setAttribute("aria-label", say("undo-what", { what: words(entry.body.text ?? say("the-mark")) }));
    undo.onclick = () => {
      endUndo();
      comments.withdraw(entry);
    };
    undoTimer = setTimeout(endUndo, UNDO_MS);
  }

  function endUndo() {
    clearTimeout(undoTimer);
    // Whoever works by keys writes on in the box. After a tap that would open a tablet's keyboard.
    if (undo.matches(":focus-visible")) box.focus();
    else if (document.activeElement === undo) undo.blur();
    undo.hidden = true;
  }

  /** @param {string | null} [taken] */
  function followOtherTabs(taken) {
    comments.followOtherTabs(taken);
    draw();
  }

  outbox.subscribe((change) => {
    comments.hear(change);
    draw();
  });
  voice.subscribe(draw);
  followDrafts(followOtherTabs);
  // A page that was asleep may have missed an event.
  document.addEventListener("visibilitychange", () => followOtherTabs());

  box.addEventListener("input", () => {
    comments.write(box.value);
    draw();
  });
  box.addEventListener("keydown", (event) => {
    if (event.key !== "Enter" || event.shiftKey || event.isComposing) return;
    event.preventDefault();
    submit();
  });
  send.onclick = submit;
  elsewhere.onclick = () => {
    const taken = comments.takeOver();
    draw();
    if (taken) box.focus();
  };
  mark.onclick = () => tap(mark, { kind: "mark" });

  return { follow };
}
