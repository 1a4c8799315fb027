// The protocol's questions, and whether the answer to each is saved. Each answer goes to the outbox the moment it is
// given. The page shows the server's answer, unless a newer one is on its way there.

import { language, say } from "../shared/language.js";

/** @typedef {import("./outbox.js").Change["state"] | "partly" | ""} Reached */
/** @typedef {import("./drafts.js").Draft} Draft */

/**
 * Sends an answer or a part of one, which was written as the draft `from`.
 *
 * @callback Give
 * @param {Api.Question} question
 * @param {Api.AnswerValue} value
 * @param {number | null} part
 * @param {ReturnType<Draft["take"]>} from
 * @returns {void}
 */

/**
 * What answers need from the rest of the page.
 *
 * @typedef {object} Context
 * @property {Give} give
 * @property {(question: Api.Question) => Draft} draft
 * @property {(run: () => void, ms: number) => () => void} later
 * @property {number} settings how many settings there are
 * @property {string[][]} said the surgeon's comments on each setting, as a reminder
 * @property {string} lot the same on every device of the session; a starting order is drawn from it
 */

/** From this many questions on, the number of answers given is shown. */
const AT_A_GLANCE = 3;

/** Recognition questions are answered with 1 for no, 2 for not sure, 3 for yes. */
const YES = 3;

const TYPING_PAUSE_MS = 900;

/**
 * Whether a whole answer is saved, or will be.
 *
 * @param {Reached} reached
 */
function isGiven(reached) {
  return reached !== "" && reached !== "partly" && reached !== "refused";
}

/**
 * Says what has become of an answer; undefined if that is not the same for all.
 *
 * @param {Reached} reached
 */
function reachedWords(reached) {
  if (reached === "saving") return say("saving");
  if (reached === "saved") return say("answer-saved");
  if (reached === "late" || reached === "waiting") return say("answer-waiting");
  return undefined;
}

/**
 * The answer that results when `given` comes after `earlier`. A 0 among points keeps the earlier point, as on the
 * server.
 *
 * @param {Api.AnswerValue | undefined} earlier
 * @param {Api.AnswerValue} given
 * @returns {Api.AnswerValue}
 */
export function onTopOf(earlier, given) {
  if (!Array.isArray(earlier) || !Array.isArray(given)) return given;
  return given.map((point, index) => point || (earlier[index] ?? 0));
}

/**
 * `1st`, `2nd`, `3rd`, `4th`, `11th`.
 *
 * @param {number} number
 */
export function ordinal(number) {
  const ending = new Intl.PluralRules(language(), { type: "ordinal" }).select(number);
  return say("place", { place: number, ending });
}

/**
 * The numbers from 1 to `count` in an order drawn from `lot`, which knows nothing of the settings. Whoever leaves the
 * starting order as it is would otherwise always prefer the first setting.
 *
 * @param {number} count
 * @param {string} lot
 */
export function drawnOrder(count, lot) {
  // FNV-1a and a linear congruential generator: enough for an order that no setting gains from.
  let state = 2166136261;
  for (const letter of lot) state = Math.imul(state ^ (letter.codePointAt(0) ?? 0), 16777619);

  const order = Array.from({ length: count }, (_, index) => index + 1);
  for (let last = count - 1; last > 0; last -= 1) {
    state = (Math.imul(state, 1664525) + 1013904223) | 0;
    const other = (state >>> 8) % (last + 1);
    [order[last], order[other]] = [order[other] ?? 0, order[last] ?? 0];
  }
  return order;
}

/** One question, and whether its answer is saved. */
class Answer {
  question;
  /** Whether the answer is saved; empty if there is none. @type {Reached} */
  reached = "";
  /** The same as text. */
  status = "";
  /** Whether this question is marked as still to be answered. */
  wanted = false;
  context;
  /** Called after each change that did not come from the form. */
  changed = () => {};

  /**
   * @param {Api.Question} question
   * @param {Context} context
   */
  constructor(question, context) {
    this.question = question;
    this.context = context;
  }

  /**
   * Text about an answer that the surgeon has begun and must still confirm; null if there is none.
   *
   * @returns {string | null}
   */
  get begun() {
    return null;
  }

  /**
   * Text about the parts that are still to be answered; null if there are none.
   *
   * @returns {string | null}
   */
  get open() {
    return null;
  }

  /**
   * For each part of the question, whether it is marked as still to be answered. Empty if it has no parts.
   *
   * @returns {boolean[]}
   */
  get wantedParts() {
    return [];
  }

  /**
   * How many parts of the question were answered, and how many it has.
   *
   * @returns {{ answered: number, total: number }}
   */
  get progress() {
    const answered = isGiven(this.reached);
    return { answered: answered ? 1 : 0, total: 1 };
  }

  /** Whether the surgeon must still do something here. */
  get unanswered() {
    if (this.begun !== null) return true;
    return !this.question.optional && !isGiven(this.reached);
  }

  /** Whether this question, or a part of it, is marked as still to be answered. */
  get marked() {
    return this.wanted || this.wantedParts.includes(true);
  }

  /**
   * Shows whether an answer is saved.
   *
   * @param {Reached} reached
   * @param {string} [reason] why it was refused
   */
  show(reached, reason = "") {
    if (this.begun !== null && reached !== "refused") {
      this.note(this.begun);
      return;
    }
    const text = reachedWords(reached) ?? reason;
    this.reached = this.open !== null && reached !== "refused" ? "partly" : reached;
    this.status = this.open === null ? text : say("partly-answered", { open: this.open, state: text });
  }

  /**
   * Shows `text` beside an answer that has not been given yet.
   *
   * @param {string} text
   */
  note(text) {
    this.reached = "partly";
    this.status = text;
  }

  /** Marks what is still to be answered. */
  want() {
    this.wanted = true;
    // It already says why an answer was refused.
    if (this.reached !== "refused") this.note(this.begun ?? say("not-answered"));
  }

  /** Removes the marks. */
  unwant() {
    this.wanted = false;
  }

  /** Gives an answer at once that would otherwise be given after a pause. */
  giveNow() {}

  /**
   * @param {Api.AnswerValue} value
   * @param {number | null} [part]
   * @param {ReturnType<Draft["take"]>} [from]
   */
  give(value, part = null, from = {}) {
    this.show("saving");
    this.wanted = false;
    this.context.give(this.question, value, part, from);
  }

  /**
   * Shows an answer that was given on another device. `busy` says whether the surgeon is working on this one.
   *
   * @param {Api.AnswerValue} value
   * @param {boolean} [busy]
   */
  take(value, busy = false) {
    // The server does not have a refused answer, so it stays in sight until the surgeon gives another.
    if (this.reached === "refused") return;
    if (this.accept(value, busy)) this.show("saved");
  }

  /**
   * Takes over `value`. Returns whether that changes anything.
   *
   * @param {Api.AnswerValue} _value
   * @param {boolean} _busy
   */
  accept(_value, _busy) {
    return false;
  }
}

/** An answer as text. It is given when the surgeon pauses or leaves the field. */
export class TextAnswer extends Answer {
  text;
  #draft;
  #answered;
  /** Whether there is a text to give. The draft cannot tell, because a full device does not keep it. */
  #written;
  #cancel = () => {};

  /**
   * @param {Api.Question} question
   * @param {Api.AnswerValue | undefined} answered
   * @param {Context} context
   */
  constructor(question, answered, context) {
    super(question, context);
    this.#draft = context.draft(question);
    const left = this.#draft.read();
    this.#answered = answered !== undefined;
    this.#written = left !== null;
    this.text = String(left ?? answered ?? "");
    if (this.#answered) this.show("saved");
    if (this.#written) this.#giveLater();
  }

  /** @param {string} text */
  write(text) {
    this.text = text;
    this.#written = true;
    this.#draft.write(text);
    this.note(say("writing"));
    this.#giveLater();
  }

  #giveLater() {
    this.#cancel();
    this.#cancel = this.context.later(() => {
      this.giveNow();
      this.changed();
    }, TYPING_PAUSE_MS);
  }

  /** @override */
  giveNow() {
    this.#cancel();
    if (!this.#written) return;
    const from = this.#draft.take();
    this.#written = false;

    const text = this.text.trim();
    if (text !== "") this.give(text, null, from);
    else this.note(this.#answered ? say("earlier-stays") : "");
  }

  /**
   * @override
   * @param {Api.AnswerValue} value
   * @param {boolean} busy
   */
  accept(value, busy) {
    if (this.#written || busy || this.text.trim() === value) return false;
    this.text = String(value);
    return true;
  }
}

/** A point on a scale, or a place on a line. */
export class ScaleAnswer extends Answer {
  /** @type {number | null} */
  point;

  /**
   * @param {Api.Question} question
   * @param {Api.AnswerValue | undefined} answered
   * @param {Context} context
   */
  constructor(question, answered, context) {
    super(question, context);
    this.point = typeof answered === "number" ? answered : null;
    if (answered !== undefined) this.show("saved");
  }

  /** @param {number} point */
  choose(point) {
    this.point = point;
    this.give(point);
  }

  /**
   * @override
   * @param {Api.AnswerValue} value
   */
  accept(value) {
    if (typeof value !== "number" || value === this.point) return false;
    this.point = value;
    return true;
  }
}

/**
 * Several items, each answered with a point, counted from 1; 0 if it is not answered. The items are those of the System
 * Usability Scale; the scales of a workload index, and then its pairs of scales, of which 1 or 2 is chosen; or the
 * settings, each with its place, which others may share.
 */
export class ItemsAnswer extends Answer {
  points;
  /** @type {boolean[]} */
  #wantedItems;

  /**
   * @param {Api.Question} question
   * @param {Api.AnswerValue | undefined} answered
   * @param {Context} context
   * @param {number} count how many items there are
   */
  constructor(question, answered, context, count) {
    super(question, context);
    this.points = Array.isArray(answered) ? [...answered] : Array.from({ length: count }, () => 0);
    this.#wantedItems = this.points.map(() => false);
    if (answered !== undefined) this.show("saved");
  }

  /** @override */
  get progress() {
    return { answered: this.points.filter((point) => point > 0).length, total: this.points.length };
  }

  /** @override @returns {string | null} */
  get open() {
    const given = this.points.filter((point) => point > 0).length;
    return given < this.points.length ? say("answered-of", { given, total: this.points.length }) : null;
  }

  /** @override */
  get wantedParts() {
    return this.#wantedItems;
  }

  /** @override */
  want() {
    this.#wantedItems = this.points.map((point) => point === 0);
  }

  /** @override */
  unwant() {
    super.unwant();
    this.#wantedItems = this.points.map(() => false);
  }

  /**
   * Sends each item by itself, so that it does not undo what another device has answered.
   *
   * @param {number} item
   * @param {number} point
   */
  choose(item, point) {
    this.points[item] = point;
    this.#wantedItems[item] = false;
    const alone = this.points.map((_, place) => (place === item ? point : 0));
    this.give(alone, item);
  }

  /**
   * @override
   * @param {Api.AnswerValue} value
   */
  accept(value) {
    if (!Array.isArray(value)) return false;
    const isNews = value.some((point, item) => point > 0 && point !== this.points[item]);
    this.points = [...value];
    this.#wantedItems = this.#wantedItems.map((wanted, item) => wanted && value[item] === 0);
    return isNews;
  }
}

/**
 * A ranking of the settings. It counts only once it is confirmed, because one tap on an arrow says nothing about the
 * other settings.
 */
export class RankingAnswer extends Answer {
  order;
  confirmed;
  #draft;

  /**
   * @param {Api.Question} question
   * @param {Api.AnswerValue | undefined} answered
   * @param {Context} context
   */
  constructor(question, answered, context) {
    super(question, context);
    this.#draft = context.draft(question);
    /** @type {number[] | null} */
    const arranged = this.#draft.read();
    const given = Array.isArray(answered) ? answered : null;
    this.order = [...(arranged ?? given ?? drawnOrder(context.settings, `${context.lot}/${question.id}`))];
    this.confirmed = given !== null && arranged === null;
    if (answered !== undefined || this.begun !== null) this.show("saved");
  }

  /** @override @returns {string | null} */
  get begun() {
    const isArranged = !this.confirmed && this.#draft.read() !== null;
    return isArranged ? say("order-kept") : null;
  }

  /**
   * The surgeon's comments on a setting, on one line.
   *
   * @param {number} setting
   */
  saidOf(setting) {
    const words = this.context.said[setting - 1] ?? [];
    return words.map((text) => `“${text}”`).join(" ");
  }

  confirm() {
    this.confirmed = true;
    this.#draft.write(null);
    this.give([...this.order]);
  }

  /**
   * Moves the setting in place `from` to place `to`. Returns the setting's number.
   *
   * @param {number} from
   * @param {number} to
   */
  move(from, to) {
    const [setting = 0] = this.order.splice(from, 1);
    this.order.splice(to, 0, setting);

    if (this.confirmed) {
      this.give([...this.order]);
    } else {
      this.#draft.write(this.order);
      this.note(this.begun ?? "");
    }
    return setting;
  }

  /**
   * @override
   * @param {Api.AnswerValue} value
   */
  accept(value) {
    if (this.begun !== null || !Array.isArray(value)) return false;
    const isNews = !this.confirmed || value.some((setting, index) => setting !== this.order[index]);
    if (!isNews) return false;
    this.confirmed = true;
    this.order = [...value];
    return true;
  }
}

/** @typedef {TextAnswer | ScaleAnswer | ItemsAnswer | RankingAnswer} AnyAnswer */

/**
 * @param {Api.Question} question
 * @param {Api.AnswerValue | undefined} answered the answer that the server has, or that is on its way there
 * @param {Context} context
 * @returns {AnyAnswer}
 */
export function answerTo(question, answered, context) {
  switch (question.kind) {
    case "text":
      return new TextAnswer(question, answered, context);
    case "likert":
    case "visual-analogue":
    case "recognition":
      return new ScaleAnswer(question, answered, context);
    case "sus":
      return new ItemsAnswer(question, answered, context, question.items.length);
    case "nasa-tlx":
      return new ItemsAnswer(question, answered, context, question.scales.length);
    case "surg-tlx":
      return new ItemsAnswer(question, answered, context, question.scales.length + question.pairs.length);
    case "ranking":
      return question.ties
        ? new ItemsAnswer(question, answered, context, context.settings)
        : new RankingAnswer(question, answered, context);
  }
}

/** The questions on screen, after a setting or at the end. */
export class Questionnaire {
  answers;

  /** @param {AnyAnswer[]} answers */
  constructor(answers) {
    this.answers = answers;
  }

  /** @param {string} question */
  find(question) {
    return this.answers.find((answer) => answer.question.id === question);
  }

  /**
   * Whether the surgeon is to see a question. One that belongs to a yes is asked only after it.
   *
   * @param {AnyAnswer} answer
   */
  isAsked({ question }) {
    if (!question.only_if_yes) return true;
    const before = this.find(question.only_if_yes);
    return before instanceof ScaleAnswer && before.point === YES;
  }

  /** Marks the questions that are still to be answered, and returns them. */
  check() {
    for (const answer of this.answers) answer.giveNow();
    const unanswered = this.answers.filter((answer) => answer.unanswered);
    for (const answer of this.answers) answer.unwant();
    for (const answer of unanswered) answer.want();
    return unanswered;
  }

  /** Says how far the surgeon is; empty where that is seen at a glance. */
  get progressWords() {
    const asked = this.answers.filter((answer) => this.isAsked(answer));
    const all = asked.map(({ progress }) => progress);
    const answered = all.reduce((sum, one) => sum + one.answered, 0);
    const total = all.reduce((sum, one) => sum + one.total, 0);
    return total < AT_A_GLANCE ? "" : say("answered-of", { given: answered, total });
  }

  /** Whether anything is marked as still to be answered. */
  get marked() {
    return this.answers.some((answer) => answer.marked);
  }

  /** Whether an answer was refused. */
  get refused() {
    return this.answers.some(({ reached }) => reached === "refused");
  }
}
