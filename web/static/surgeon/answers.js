// Where answers are kept on this device until they are saved: in the outbox, and as drafts while
// they are being written.

export const PATH = "/api/surgeon/answers";

/**
 * The questions of a session: after a setting, by its segment, or at the end, where the segment is
 * null.
 *
 * @typedef {{ session: string, segment: string | null }} Place
 */

/**
 * Where the questions on screen belong.
 *
 * @param {Api.SurgeonView} state
 * @returns {Place}
 */
export function placeOf(state) {
  return { session: state.session, segment: state.phase === "questions" ? (state.segment ?? null) : null };
}

/**
 * The name of a question's place on this device.
 *
 * @param {Place} place
 * @param {string} question
 */
export function slotOf({ session, segment }, question) {
  return `${session}/${segment ?? "closing"}/${question}`;
}

/**
 * Sends text answers that were left half-written, in whatever tab, by questions that are no longer
 * on screen: as they stand.
 *
 * @param {import("./outbox.js").Outbox} outbox
 * @param {import("./drafts.js").Drafts} drafts
 * @param {Api.SurgeonView | null} state
 */
export function sendLeftAnswers(outbox, drafts, state) {
  const onScreen =
    state?.phase === "questions" || state?.phase === "closing" ? slotOf(placeOf(state), "") : null;

  for (const left of drafts.of("answer.")) {
    const { rest: slot, value: text } = left;
    if (typeof text !== "string" || (onScreen !== null && slot.startsWith(onScreen))) continue;

    const [session, segment, ...question] = slot.split("/");
    const about = { session, segment: segment === "closing" ? null : segment, question: question.join("/") };
    if (text.trim()) outbox.add(PATH, { ...about, value: text.trim() }, slot, left);
    drafts.forget(left);
  }
}
