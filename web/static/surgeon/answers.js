// Where answers are kept on this device until the server has saved them: in the outbox, or as drafts while they are
// being written.

export const PATH = "/api/surgeon/answers";

/**
 * A set of questions in a session: those after a setting, named by its segment, or those at the end (null).
 *
 * @typedef {{ session: string, segment: string | null }} Place
 */

/**
 * The place of the questions on screen.
 *
 * @param {Api.SurgeonView} state
 * @returns {Place}
 */
export function placeOf(state) {
  return { session: state.session, segment: state.phase === "questions" ? (state.segment ?? null) : null };
}

/**
 * The name under which this device keeps the answer to a question.
 *
 * @param {Place} place
 * @param {string} question
 */
export function slotOf({ session, segment }, question) {
  return `${session}/${segment ?? "closing"}/${question}`;
}

/**
 * Sends text answers that were left half-written, in any tab, if their questions are no longer on screen. They are sent
 * as they are. A ranking that was not confirmed is no answer, so it is only removed from this device.
 *
 * @param {import("./outbox.js").Outbox} outbox
 * @param {import("./drafts.js").Drafts} drafts
 * @param {Api.SurgeonView | null} state
 */
export function sendLeftAnswers(outbox, drafts, state) {
  const onScreen =
    state?.phase === "questions" || state?.phase === "closing" ? slotOf(placeOf(state), "") : null;

  for (const left of drafts.of("answer.")) {
    const { rest: slot, value } = left;
    if (onScreen && slot.startsWith(onScreen)) continue;

    const [session, segment, ...question] = slot.split("/");
    const about = { session, segment: segment === "closing" ? null : segment, question: question.join("/") };
    const text = typeof value === "string" && value.trim();
    if (text) outbox.add(PATH, { ...about, value: text }, slot, left);
    drafts.forget(left);
  }
}
