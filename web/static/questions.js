// The protocol's questions as a form. Each answer goes to the outbox the moment it is given and shows whether it is
// saved; what stands in the form is what the server has, unless something newer is on its way.

import { make, setText } from "./dom.js";

const SUS_ITEMS = [
  "I think that I would like to use this system frequently.",
  "I found the system unnecessarily complex.",
  "I thought the system was easy to use.",
  "I think that I would need the support of a technical person to be able to use this system.",
  "I found the various functions in this system were well integrated.",
  "I thought there was too much inconsistency in this system.",
  "I would imagine that most people would learn to use this system very quickly.",
  "I found the system very cumbersome to use.",
  "I felt very confident using the system.",
  "I needed to learn a lot of things before I could get going with this system.",
];
const TYPING_PAUSE_MS = 900;

/**
 * Draws `questions` and returns the form.
 *
 * `context.give(question, value)` sends an answer; `context.draft(question)` keeps parts of an answer that is not whole
 * yet; `context.answers` maps question ids to answers already given; `context.settings` is how many settings there are.
 */
export function questionForm(questions, context) {
  const draw = { text: textQuestion, likert: likertQuestion, ranking: rankingQuestion, sus: susQuestion };
  return questions.map((question) => {
    const state = make("p", { className: "state", role: "status" });
    const answered = context.answers[question.id];
    if (answered !== undefined) showState(state, "saved");
    const body = draw[question.kind](question, answered, {
      ...context,
      give: (value) => {
        showState(state, "saving");
        context.give(question, value);
      },
      draft: context.draft(question),
      partly: (text) => showState(state, "partly", text),
    });
    const box = make("fieldset", { className: "question", "data-question": question.id }, ...body, state);
    return box;
  });
}

const STATES = { saving: "Saving…", saved: "Saved", waiting: "Kept on this device; will be saved when the connection is back" };

/** Shows how far an answer has got; for a refusal `reason` says why. */
export function showState(element, state, reason = "") {
  element.className = `state ${state}`;
  setText(element, STATES[state] ?? reason);
}

function asked(question, tag = "legend") {
  const optional = question.optional ? make("span", { className: "optional" }, " (optional)") : null;
  return make(tag, { className: "ask", id: `ask-${question.id}` }, question.text, optional);
}

function textQuestion(question, answered, context) {
  const area = make("textarea", { rows: 3, "aria-labelledby": `ask-${question.id}`, value: context.draft.read() ?? answered ?? "" });
  let timer = null;
  const given = () => {
    clearTimeout(timer);
    if (context.draft.read() === null) return;
    context.draft.write(null);
    if (area.value.trim() === "") return context.partly(answered ? "The earlier answer stays until you write another." : "");
    context.give(area.value.trim());
  };
  area.addEventListener("input", () => {
    context.draft.write(area.value);
    context.partly("Writing…");
    clearTimeout(timer);
    timer = setTimeout(given, TYPING_PAUSE_MS);
  });
  area.addEventListener("change", given);
  area.give = given;
  if (context.draft.read() !== null) timer = setTimeout(given, TYPING_PAUSE_MS);
  return [asked(question), area];
}

function likertQuestion(question, answered, context) {
  return [asked(question), scale(question.id, question, answered, context.give)];
}

/** Radio buttons 1..=points with what the ends mean. */
function scale(name, { points, low, high }, chosen, give) {
  const ends = make("div", { className: "ends", "aria-hidden": "true" }, make("span", {}, low), make("span", {}, high));
  const buttons = Array.from({ length: points }, (_, index) => {
    const value = index + 1;
    const meaning = value === 1 ? low : value === points ? high : "";
    const input = make("input", { type: "radio", name, value, checked: value === chosen, "aria-label": `${value} of ${points}${meaning ? `, ${meaning}` : ""}` });
    input.addEventListener("change", () => give(value));
    return make("label", {}, input, make("span", { "aria-hidden": "true" }, String(value)));
  });
  return make("div", { className: "likert" }, make("div", { className: "points" }, ...buttons), ends);
}

function susQuestion(question, answered, context) {
  const points = answered ?? context.draft.read() ?? Array(SUS_ITEMS.length).fill(0);
  const progress = () => points.filter((point) => point > 0).length;
  const items = SUS_ITEMS.map((text, index) => {
    const ends = { points: 5, low: "Strongly disagree", high: "Strongly agree" };
    const choose = (value) => {
      points[index] = value;
      if (progress() === points.length) {
        context.draft.write(null);
        context.give([...points]);
      } else {
        context.draft.write(points);
        context.partly(`${progress()} of ${points.length} answered`);
      }
    };
    return make("fieldset", {}, make("legend", {}, `${index + 1}. ${text}`), scale(`${question.id}-${index}`, ends, points[index], choose));
  });
  if (answered === undefined && progress() > 0) context.partly(`${progress()} of ${points.length} answered`);
  return [asked(question), make("div", { className: "sus" }, ...items)];
}

function rankingQuestion(question, answered, context) {
  const order = answered ? [...answered] : Array.from({ length: context.settings }, (_, index) => index + 1);
  const list = make("ol", { className: "ranking" });
  const heard = make("p", { className: "visually-hidden", "aria-live": "polite" });
  const confirm = make("button", { type: "button", className: "confirm", hidden: answered !== undefined }, "This order is right");
  confirm.onclick = () => settle();
  const settle = () => {
    confirm.hidden = true;
    context.give([...order]);
  };
  const move = (from, to) => {
    const [setting] = order.splice(from, 1);
    order.splice(to, 0, setting);
    draw();
    const [up, down] = list.children[to].querySelectorAll("button");
    (to < from ? (up.disabled ? down : up) : down.disabled ? up : down).focus();
    setText(heard, `Setting ${setting} is now in place ${to + 1} of ${order.length}`);
    settle();
  };
  const mover = (label, sign, from, to) => {
    const button = make("button", { type: "button", "aria-label": label, disabled: to < 0 || to >= order.length }, sign);
    button.onclick = () => move(from, to);
    return button;
  };
  const draw = () =>
    list.replaceChildren(
      ...order.map((setting, index) =>
        make("li", {}, make("span", { className: "place" }, `${place(index + 1)}${index === 0 ? ", best" : ""}`), make("span", {}, `Setting ${setting}`),
          mover(`Move setting ${setting} up`, "↑", index, index - 1), mover(`Move setting ${setting} down`, "↓", index, index + 1)),
      ),
    );
  draw();
  return [asked(question), list, heard, confirm];
}

function place(number) {
  const ending = ["th", "st", "nd", "rd"][number % 10] ?? "th";
  return `${number}${number >= 11 && number <= 13 ? "th" : ending}`;
}
