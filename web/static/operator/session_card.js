// The card of the session under way: its state, what the operator can do with it, and its comments and events.

import { post, Refused } from "../shared/api.js";
import { askReason, askWhetherMeant } from "../shared/dialogs.js";
import { byId, make, redraw, setText } from "../shared/dom.js";
import { secondText } from "../shared/text.js";
import { tell, tellTrouble } from "../shared/trouble.js";
import { askConsent } from "./consent.js";
import { exceptDouble, ignoreHeldKeys } from "./double_click.js";
import {
  commentWords,
  consentWords,
  deeds,
  lacksConsent,
  phaseWords,
  reasonWords,
  steps,
  timeLeft,
  unrecordedWords,
} from "./session_words.js";

/** @typedef {Api.OperatorView} View */
/** @typedef {import("./session_words.js").Deed} Deed */

export class SessionCard {
  #followAnswer;
  /** @type {View | null} */
  #session = null;
  /** When the setting's time ends, by the page's clock. @type {number | null} */
  #endsAt = null;
  /**
   * The pause whose reason is asked for. It stays the same while a reason is being written.
   *
   * @type {View["reason_wanted"]}
   */
  #reasonFor = null;

  /** @param {(answer: Promise<View | null>) => Promise<void>} followAnswer */
  constructor(followAnswer) {
    this.#followAnswer = followAnswer;
    ignoreHeldKeys(byId("session-actions"));
    byId("reason-wanted", HTMLFormElement).onsubmit = (event) => {
      event.preventDefault();
      this.#giveReason();
    };
    byId("pause-reason").addEventListener(
      "input",
      () => this.#session && this.#drawReasonWanted(this.#session),
    );
  }

  /** @param {View | null} session */
  follow(session) {
    // The button that was pressed goes away, and would take the focus to the page's beginning.
    const isHere = byId("session-card").contains(document.activeElement);
    if (session?.session !== this.#session?.session) byId("pause-reason", HTMLInputElement).value = "";
    this.#session = session;
    const seconds = session?.remaining_seconds;
    this.#endsAt = seconds == null ? null : performance.now() + seconds * 1000;

    byId("new-session").hidden = session !== null;
    byId("running").hidden = session === null;
    byId("follow").hidden = session === null;
    this.#drawBadges();
    if (session) this.#draw(session);
    if (isHere) focusNext();
  }

  /** @param {View} session */
  #draw(session) {
    setText(byId("phase"), phaseWords(session));
    byId("unrecorded").hidden = !session.unrecorded;
    setText(byId("unrecorded"), unrecordedWords(session));
    setText(byId("consent"), consentWords(session));
    byId("consent").className = lacksConsent(session) || session.withdrawn ? "notice-line warn" : "muted";
    byId("consent").hidden = consentWords(session) === "";
    byId("steps").replaceChildren(...steps(session).map((className) => make("li", { className })));
    this.#drawDeeds(session);
    this.#drawReasonWanted(session);
    drawFeed(session);
    this.drawTime();
  }

  #drawBadges() {
    const session = this.#session;
    const badge = (/** @type {string} */ text, level = "") =>
      make("span", { className: `badge ${level}` }, text);
    const badges = session
      ? [
          badge(session.participant),
          ...(session.practice ? [badge("Practice", "warn")] : []),
          ...(session.paused ? [badge("Paused", "warn")] : []),
        ]
      : [];
    redraw(byId("session-badges"), badges);
  }

  drawTime() {
    if (!this.#session) return;
    const left = this.#endsAt === null ? null : (this.#endsAt - performance.now()) / 1000;
    setText(byId("remaining"), timeLeft(this.#session, left));
  }

  /** @param {View} session */
  #drawDeeds(session) {
    const buttons = deeds(session).map(({ deed, label, className }) =>
      make("button", { type: "button", className, onclick: exceptDouble(() => this.#do(deed)) }, label),
    );
    redraw(byId("session-actions"), buttons);
  }

  /**
   * A reason that is being written stays in the box, and with its pause, while the session moves on. It goes once the
   * pause has a reason, perhaps from another operator: the server asks for the latest pause that has none.
   *
   * @param {View} session
   */
  #drawReasonWanted({ reason_wanted: wanted }) {
    const box = byId("pause-reason", HTMLInputElement);
    const lacksReason = wanted && this.#reasonFor && wanted.event >= this.#reasonFor.event;
    if (!lacksReason) box.value = "";
    if (box.value === "") this.#reasonFor = wanted;
    const about = this.#reasonFor;
    byId("reason-wanted").hidden = !wanted;
    if (about) setText(byId("pause-reason-label"), reasonWords(secondText(about.at), about));
  }

  async #giveReason() {
    const box = byId("pause-reason", HTMLInputElement);
    const event = this.#reasonFor?.event;
    const reason = box.value.trim();
    const save = byId("save-reason", HTMLButtonElement);
    if (event === undefined || reason === "" || save.disabled) return;

    save.disabled = true;
    const given = await this.#act({ action: "give-reason", event, reason });
    save.disabled = false;
    if (!given) return;

    // Another pause may still lack its reason, and is asked for next.
    this.#reasonFor = null;
    if (this.#session) this.#drawReasonWanted(this.#session);
  }

  /** @param {Deed} deed */
  #do(deed) {
    if (!this.#session) return;
    switch (deed) {
      case "start":
        return this.#act({ action: "start" });
      case "resume":
        return this.#act({ action: "resume" });
      case "end-setting":
        return this.#askEndSetting(this.#session);
      case "pause":
        return this.#act({ action: "pause", reason: "" });
      case "abort":
        return this.#askAbort(this.#session);
      case "consent":
        return this.#askConsent(this.#session);
      case "withdraw":
        return this.#askWithdrawal(this.#session);
      case "dismiss":
        return this.#dismiss(this.#session);
    }
  }

  /** @param {View} view */
  #askEndSetting({ session, segment, setting }) {
    if (!segment) return;
    askWhetherMeant({
      heading: `End setting ${setting} now`,
      consequence:
        "The surgeon’s time with this setting ends now, and the questions about it follow. " +
        "This cannot be undone. All comments are kept.",
      go: `End setting ${setting}`,
      done: () => this.#send(session, { action: "finish-segment", segment }),
    });
  }

  /** @param {View} view */
  #askAbort({ session }) {
    askReason({
      heading: "Abort the session",
      consequence: "The session ends and cannot be continued. All comments and answers so far are kept.",
      go: "Abort session",
      danger: true,
      done: (reason) => this.#send(session, { action: "abort", reason }),
    });
  }

  /** @param {View} view */
  #askConsent(view) {
    askConsent(view, (consent) => this.#followAnswer(post("/api/operator/consents", consent)));
  }

  /** @param {View} view */
  #askWithdrawal({ session }) {
    askReason({
      heading: "The participant withdraws",
      consequence:
        "From now on this session’s data are not shown, analysed or exported. " +
        "The record keeps that it was withdrawn. This cannot be undone.",
      go: "Withdraw session",
      danger: true,
      done: (reason) => this.#send(session, { action: "withdraw", reason }),
    });
  }

  /** @param {View} view */
  #dismiss({ session }) {
    return this.#attempt(this.#followAnswer(post("/api/operator/dismissals", { session })));
  }

  /**
   * Does `action` on `session`, the session shown when the operator asked for it. Throws if another operator has closed
   * that session since.
   *
   * @param {string} session
   * @param {Api.Action} action
   */
  async #send(session, action) {
    if (this.#session?.session !== session) {
      throw new Refused(409, "This session was closed in the meantime. Nothing was done.", true);
    }
    await this.#followAnswer(post("/api/operator/actions", { session, ...action }));
  }

  /**
   * Returns whether it was done.
   *
   * @param {Api.Action} action
   */
  async #act(action) {
    return this.#session !== null && this.#attempt(this.#send(this.#session.session, action));
  }

  /**
   * Returns whether it was done, and says in the card why not.
   *
   * @param {Promise<void>} deed
   */
  async #attempt(deed) {
    try {
      await deed;
      tell(byId("session-trouble"), "");
      return true;
    } catch (error) {
      tellTrouble(byId("session-trouble"), error);
      return false;
    }
  }
}

/** Gives the focus to what comes next in the card, if it was lost. */
function focusNext() {
  const active = document.activeElement;
  const isLost = active === null || active === document.body || active.getClientRects().length === 0;
  if (!isLost) return;
  /** @type {HTMLElement | null} */
  const next =
    document.querySelector("#session-actions .primary") ??
    document.querySelector("#session-actions button:not(.danger)") ??
    document.querySelector("#session-actions button");
  const inForm = byId("participant");
  (byId("running").hidden ? inForm : next)?.focus();
}

/**
 * Comments and events, newest first.
 *
 * @param {View} session
 */
function drawFeed(session) {
  setText(byId("comment-count"), String(session.comments));
  const comments = session.latest_comments.map((comment) => {
    const where = comment.setting
      ? make("span", { className: "who" }, `setting ${comment.setting} · `)
      : null;
    return make("li", {}, timeOf(comment.at), make("span", {}, where, commentWords(comment)));
  });
  const why = session.withdrawn ? "No longer shown: the participant withdrew." : "None yet.";
  const none = make("li", { className: "empty" }, why);
  redraw(byId("comments"), comments.length > 0 ? comments : [none]);

  const events = session.log.map((line) => {
    const by = make("span", { className: "who" }, ` · ${line.account ? `${line.account}, ` : ""}${line.by}`);
    return make("li", {}, timeOf(line.at), make("span", {}, line.text, by));
  });
  redraw(byId("log"), events);
}

/** @param {string} at */
function timeOf(at) {
  const text = secondText(at);
  return make("time", { dateTime: at, title: at }, text);
}
