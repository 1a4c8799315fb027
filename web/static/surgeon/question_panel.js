// The questions on screen: draws them, sends the answers, and says which questions are still open.

import { make, setText } from "../shared/dom.js";
import { say } from "../shared/language.js";
import { tell, tellUntilAnswered } from "../shared/trouble.js";
import { PATH, placeOf, slotOf } from "./answers.js";
import { drafts, later } from "./device.js";
import { questionBox } from "./question_form.js";
import { answerTo, onTopOf, Questionnaire } from "./questions.js";

/** @typedef {Api.SurgeonView} View */
/** @typedef {import("./question_form.js").QuestionBox} QuestionBox */

export class QuestionPanel {
  #outbox;
  #finish;
  #place;
  #questionnaire;
  /** @type {QuestionBox[]} */
  #boxes;
  #progress = make("p", { className: "progress number" });
  #missing = make("p", { id: "missing", className: "message", role: "alert" });

  /**
   * @param {View} state
   * @param {import("./outbox.js").Outbox} outbox
   * @param {(segment: string | null) => Promise<void>} finish tells the server that the questions are done
   */
  constructor(state, outbox, finish) {
    this.#outbox = outbox;
    this.#finish = finish;
    // Answers belong to this place, even if the session has moved on meanwhile.
    this.#place = placeOf(state);

    const answers = state.questions.map((question) => this.#answer(question, state));
    for (const answer of answers) {
      const refused = this.#outbox.refusedFor(slotOf(this.#place, answer.question.id)).at(-1);
      if (refused) answer.show("refused", refused.refusal);
      // The answer was given before the questions were drawn again, and is not on the server yet.
      if (this.#isPending(answer.question.id)) answer.show("waiting");
    }
    this.#questionnaire = new Questionnaire(answers);
    this.#boxes = answers.map((answer) => questionBox(answer, () => this.#settled()));
    this.#showAsked();
  }

  /** Shows the questions that are asked, and no others. */
  #showAsked() {
    for (const { answer, element } of this.#boxes) element.hidden = !this.#questionnaire.isAsked(answer);
  }

  /**
   * @param {Api.Question} question
   * @param {View} state
   */
  #answer(question, state) {
    const slot = slotOf(this.#place, question.id);
    let answered = state.answers[question.id];
    for (const { body } of [...this.#outbox.refusedFor(slot), ...this.#outbox.pending(slot)]) {
      answered = onTopOf(answered, body.value);
    }

    return answerTo(question, answered, {
      settings: state.settings,
      said: state.said ?? [],
      lot: state.session,
      later,
      draft: () => drafts.open(`answer.${slot}`),
      give: (_, value, part, from) => {
        const body = { ...this.#place, question: question.id, value };
        this.#outbox.add(PATH, body, part === null ? slot : `${slot}/${part}`, from);
      },
    });
  }

  /**
   * @param {string} heading
   * @returns {import("./panel.js").Content}
   */
  content(heading) {
    const label = this.#place.segment === null ? say("finish") : say("continue");
    const done = make("button", { type: "button", className: "primary", onclick: () => this.#done() }, label);
    const form = make(
      "div",
      { className: "questions" },
      make("h2", { tabIndex: -1 }, heading),
      ...this.#boxes.map(({ element }) => element),
      make("div", { className: "done" }, this.#progress, this.#missing, done),
    );
    this.#drawProgress();
    return { className: "asking", nodes: [form] };
  }

  async #done() {
    const unanswered = this.#questionnaire.check();
    this.#draw();
    if (unanswered.length > 0) {
      this.#showUnanswered(unanswered);
      return;
    }

    tell(this.#missing, say("saving"));
    if (!(await this.#outbox.settled(PATH))) {
      tellUntilAnswered(this.#missing, say("answers-kept", { trouble: this.#outbox.trouble ?? "" }));
      return;
    }
    if (this.#questionnaire.refused) {
      tell(this.#missing, say("answer-refused"));
      return;
    }

    // If this fails, the dock right beneath says why.
    await this.#finish(this.#place.segment);
    tell(this.#missing, "");
  }

  /** @param {import("./questions.js").AnyAnswer[]} unanswered */
  #showUnanswered(unanswered) {
    tell(this.#missing, say("questions-open", { count: unanswered.length }));

    const first = this.#boxes.find(({ answer }) => answer === unanswered[0])?.wantedPlace();
    first?.scrollIntoView({ block: "center" });
    /** @type {HTMLElement | null | undefined} */
    const field = first?.querySelector("[role=slider], input, textarea, button.confirm");
    field?.focus({ preventScroll: true });
  }

  /** The surgeon has changed an answer. Clears the message about open questions once none is marked as open. */
  #settled() {
    if (!this.#questionnaire.marked) tell(this.#missing, "");
    this.#showAsked();
    this.#drawProgress();
  }

  /**
   * Whether an answer to `question` is waiting on this device to be sent.
   *
   * @param {string} question
   */
  #isPending(question) {
    return this.#outbox.pending(slotOf(this.#place, question)).length > 0;
  }

  /**
   * Shows the answers that were given on another device meanwhile.
   *
   * @param {View} state
   */
  takeAnswers(state) {
    for (const { answer, isBusy } of this.#boxes) {
      const value = state.answers[answer.question.id];
      const isPending = this.#isPending(answer.question.id);
      if (value !== undefined && !isPending) answer.take(value, isBusy());
    }
    this.#draw();
  }

  /**
   * Shows whether the answer to `question` is saved.
   *
   * @param {string} question
   * @param {import("./outbox.js").Change["state"]} reached
   * @param {string | null} reason
   */
  show(question, reached, reason) {
    this.#questionnaire.find(question)?.show(reached, reason ?? "");
    this.#draw();
  }

  #draw() {
    for (const box of this.#boxes) box.draw();
    this.#showAsked();
    this.#drawProgress();
  }

  #drawProgress() {
    setText(this.#progress, this.#questionnaire.progressWords);
  }
}
