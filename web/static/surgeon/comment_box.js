// The comment box, the quick comments and "Mark this moment". A comment belongs to the setting it was begun under, even
// when the setting changes while it is being written. One begun in another tab is offered, not shown.

import { byId, make, setText } from "../shared/dom.js";
import { Draft, draftsOf, followDrafts, forgetDraft } from "./drafts.js";

const PATH = "/api/surgeon/comments";
/** A second tap on the same button within this time is the same tap. */
const SAME_TAP_MS = 700;
/** As much of a draft elsewhere as its button shows. */
const OFFERED_LETTERS = 16;

const begin = ({ segment, setting, frame, run }) => ({ segment, setting, frame, run });

/** `now()` gives `{ session, segment, setting, frame, run }` as on screen at this moment, or null outside a session. */
export function composer(outbox, now) {
  const box = byId("comment");
  const about = byId("about");
  const status = byId("comment-state");
  const trouble = byId("comment-trouble");
  const quick = byId("quick");
  const mark = byId("mark");
  const send = byId("send");
  const elsewhere = byId("elsewhere");
  /** The number of each setting that was on screen. */
  const numbers = new Map();
  let draft = null;
  let begun = null;
  let kept = 0;
  let shown;

  function follow(state) {
    const session = state?.session ?? null;
    if (session !== shown) {
      sendBox();
      shown = session;
      sendLeft(session);
      draft = session && new Draft(`comment.${session}`);
      const left = draft?.read();
      begun = left?.begun ?? null;
      write(left?.text ?? "");
      setText(trouble, "");
    }
    if (state?.segment != null) numbers.set(state.segment, state.setting);
    const over = !state || state.phase === "completed" || state.phase === "aborted";
    box.disabled = over && box.value === "";
    byId("compose").hidden = box.disabled && state !== null;
    box.placeholder = state ? "Write what you see" : "Comments are kept once a trial begins";
    const looking = state?.phase === "inspecting";
    mark.hidden = !looking;
    kept = state?.comments ?? 0;
    drawQuick(looking ? state.quick_comments : []);
    drawState();
  }

  /** What stands in the box is sent as it stands: it is about the session that goes. */
  function sendBox() {
    const text = box.value.trim();
    // The tab that took it over sends it.
    if (!shown || text === "" || draft.claimed) return;
    const about = { session: shown, ...begun };
    outbox.add(PATH, said({ kind: "text", text }, about), null, draft.take());
  }

  /** Half-written comments on sessions that were put away are sent as they stand: their box is gone. */
  function sendLeft(session) {
    for (const left of draftsOf("comment.")) {
      if (left.rest === session) continue;
      const text = left.value.text?.trim();
      const about = { session: left.rest, ...left.value.begun };
      if (text) outbox.add(PATH, said({ kind: "text", text }, about), null, left);
      forgetDraft(left);
    }
  }

  /** Follows what other tabs do with drafts; one has sent or taken over the one in `taken`, if that is given. */
  function followOtherTabs(taken = null) {
    if (draft && (draft.isIn(taken) || draft.claimed)) write("");
    drawOffer();
  }

  /** Offers what was begun in another tab, while nothing is being written here. */
  function drawOffer() {
    const other = box.disabled || box.value !== "" ? undefined : begunElsewhere();
    elsewhere.hidden = !other;
    if (!other) return;
    const text = other.value.text.trim();
    const letters = [...text];
    const start = letters.length > OFFERED_LETTERS ? `${letters.slice(0, OFFERED_LETTERS).join("")}…` : text;
    setText(elsewhere, `Continue “${start}”`);
    elsewhere.title = `Begun in another tab: ${text}`;
  }

  const begunElsewhere = () => draft?.elsewhere().find(({ value }) => value.text?.trim());

  function takeOver() {
    const other = begunElsewhere();
    if (!other) return drawOffer();
    draft.claim(other);
    begun = other.value.begun ?? null;
    write(other.value.text);
    box.focus();
  }

  function drawQuick(texts) {
    if (quick.dataset.texts === JSON.stringify(texts)) return;
    quick.dataset.texts = JSON.stringify(texts);
    quick.hidden = texts.length === 0;
    quick.replaceChildren(...texts.map((text) => make("button", { type: "button", onclick: (event) => tap(event.currentTarget, { kind: "quick", text }) }, text)));
  }

  function drawState() {
    send.disabled = box.value.trim() === "";
    send.classList.toggle("primary", !send.disabled);
    const waiting = outbox.waiting.filter((entry) => entry.path === PATH).length;
    if (waiting === 0) setText(status, kept === 0 ? "" : kept === 1 ? "1 comment saved" : `${kept} comments saved`);
    else if (outbox.trouble) setText(status, `${waiting === 1 ? "1 comment" : `${waiting} comments`} not saved yet, kept on this ${outbox.durable ? "device" : "page: do not close it"}. ${outbox.trouble}`);
    else setText(status, "Saving…");
    status.classList.toggle("saved", waiting === 0);
    status.classList.toggle("unsaved", waiting > 0 && outbox.trouble !== null);
    const here = now();
    const otherSetting = begun && begun.setting > 0 && begun.segment !== here?.segment && box.value !== "";
    about.hidden = !otherSetting;
    drawOffer();
    if (otherSetting) setText(about, `This comment is about setting ${begun.setting}.`);
  }

  const said = (what, { session, segment = null, frame = null, run = null }) => ({ session, segment, frame, run, ...what });

  function tap(button, what) {
    const place = now();
    if (!place || button.dataset.busy) return;
    button.dataset.busy = "yes";
    button.classList.add("taken");
    setTimeout(() => {
      delete button.dataset.busy;
      button.classList.remove("taken");
    }, SAME_TAP_MS);
    outbox.add(PATH, said(what, place));
  }

  function submit() {
    const place = now();
    const text = box.value.trim();
    if (!place || text === "") return;
    // It was said now, whenever it was begun.
    const { key } = draft.take();
    outbox.add(PATH, said({ kind: "text", text }, { ...place, ...begun }), null, { key });
    write("");
    setText(trouble, "");
    box.focus();
  }

  function write(text) {
    if (box.value !== text) box.value = text;
    if (text === "") begun = null;
    else if (!begun && now()) begun = begin(now());
    draft?.write(text === "" ? null : { text, begun });
    box.classList.toggle("tall", text.length > 90 || text.includes("\n"));
    drawState();
  }

  outbox.addEventListener("change", ({ detail: { entry, state, reason } }) => {
    if (entry.path !== PATH) return;
    if (state === "refused") refused(entry, reason);
    drawState();
  });

  function refused(entry, reason) {
    const { body } = entry;
    if (body.session !== shown) return;
    if (body.kind === "text") {
      outbox.forget(entry);
      begun ??= { segment: body.segment, setting: numbers.get(body.segment) ?? 0, frame: body.frame, run: body.run };
      write(box.value === "" ? body.text : `${body.text}\n${box.value}`);
    }
    const what = body.kind === "text" ? "The comment was not saved, it is back in the box" : body.kind === "mark" ? "The mark was not saved" : `“${body.text}” was not saved`;
    setText(trouble, `${what}: ${reason}`);
  }

  followDrafts(followOtherTabs);
  // A page that was put to sleep may not have been told.
  document.addEventListener("visibilitychange", () => followOtherTabs());
  box.addEventListener("input", () => write(box.value));
  box.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && !event.shiftKey && !event.isComposing) {
      event.preventDefault();
      submit();
    }
  });
  send.onclick = submit;
  elsewhere.onclick = takeOver;
  mark.onclick = () => tap(mark, { kind: "mark" });
  return { follow, draw: drawState, unsent: () => box.value.trim() !== "" };
}
