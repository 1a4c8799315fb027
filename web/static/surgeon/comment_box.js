// The comment box, the quick comments and "Mark this moment".

import { byId, make, setText } from "../shared/dom.js";
import { followDrafts } from "./device.js";

/** A second tap on the same button within this time is ignored. */
const SAME_TAP_MS = 700;

/** A text longer than this gets a taller box. */
const TALL_LETTERS = 90;

/**
 * Draws `comments`, and passes the surgeon's input on to them.
 *
 * @param {import("./comments.js").Comments} comments
 * @param {import("./outbox.js").Outbox} outbox
 */
export function commentBox(comments, outbox) {
  const box = byId("comment", HTMLTextAreaElement);
  const mark = byId("mark", HTMLButtonElement);
  const send = byId("send", HTMLButtonElement);
  const elsewhere = byId("elsewhere");
  const quick = byId("quick");
  /** Buttons tapped a moment ago. @type {Set<HTMLElement>} */
  const tapped = new Set();
  let quickDrawn = "[]";

  /** @param {Api.SurgeonView | null} state */
  function follow(state) {
    comments.follow(state);
    box.disabled = comments.disabled;
    byId("compose").hidden = comments.disabled && state !== null;
    box.placeholder = state ? "Write what you see" : "Comments are kept once a trial begins";

    const looking = state?.phase === "inspecting";
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
        const button = make("button", { type: "button" }, text);
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
    if (setting !== null) setText(byId("about"), `This comment is about setting ${setting}.`);

    const { offer } = comments;
    elsewhere.hidden = offer === null;
    if (offer) {
      setText(elsewhere, `Continue “${offer.start}”`);
      elsewhere.title = `Begun in another tab: ${offer.whole}`;
    }
  }

  /**
   * @param {HTMLElement} button
   * @param {import("./comments.js").Said} what
   */
  function tap(button, what) {
    if (tapped.has(button) || !comments.say(what)) return;
    tapped.add(button);
    button.classList.add("taken");
    setTimeout(() => {
      tapped.delete(button);
      button.classList.remove("taken");
    }, SAME_TAP_MS);
  }

  function submit() {
    if (!comments.submit()) return;
    draw();
    box.focus();
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
