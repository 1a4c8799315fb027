// The protocol's questions as a form. Each answer goes to the outbox the moment it is given and shows whether it is
// saved; what stands in the form is what the server has, unless something newer is on its way.

import { make, setText } from "../shared/dom.js";

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
 * `context.give(question, value, part, from)` sends an answer, or part `part` of one, written as the draft `from`;
 * `context.draft(question)` keeps a text that is being written; `context.answers` maps question ids to answers already given; `context.settings` is how many settings
 * there are. Each question's element has `show(state, reason)`, which tells how far its answer has got; `take(value)`,
 * which shows an answer given on another device; `begun()`, whether something in it waits for a word of the surgeon's; and
 * `want(wanted)`, which marks what is still to be answered, or takes the marks back, and gives the first such place.
 */
export function questionForm(questions, context) {
  const draw = { text: textQuestion, likert: likertQuestion, ranking: rankingQuestion, sus: susQuestion };
  return questions.map((question) => {
    const state = make("p", { className: "state", role: "status" });
    const answered = context.answers[question.id];
    const { nodes, take, open = () => null, begun = () => null, gaps = () => [box] } = draw[question.kind](question, answered, {
      ...context,
      give: (value, part, from) => {
        box.show("saving");
        context.give(question, value, part, from);
      },
      draft: context.draft(question),
      partly: (text) => showState(state, "partly", text),
    });
    const box = make("fieldset", { className: "question", "data-question": question.id }, ...nodes, state);
    box.show = (reached, reason) => (begun() && reached !== "refused" ? showState(state, "partly", begun()) : showState(state, reached, reason, open()));
    box.begun = () => begun() !== null;
    box.want = (wanted) => {
      const places = wanted ? gaps() : [];
      for (const marked of [box, ...box.querySelectorAll(".wanting")]) marked.classList.remove("wanting");
      for (const place of places) place.classList.add("wanting");
      if (places.includes(box)) showState(state, "partly", begun() ?? "Not answered yet");
      return places[0];
    };
    box.take = (value) => {
      if (take(value)) box.show("saved");
    };
    if (answered !== undefined || begun()) box.show("saved");
    return box;
  });
}

/** What stands once `given` has come on top of `earlier`: a 0 among points leaves what was there, as on the server. */
export function onTopOf(earlier, given) {
  return Array.isArray(earlier) && Array.isArray(given) ? given.map((point, index) => point || earlier[index]) : given;
}

const STATES = { saving: "Saving…", saved: "Saved", waiting: "Kept on this device; will be saved when the connection is back" };

/** Shows how far an answer has got; for a refusal `reason` says why, `open` what is still to be answered. */
function showState(element, state, reason = "", open = null) {
  element.className = `state ${open && state !== "refused" ? "partly" : state}`;
  const text = STATES[state] ?? reason;
  setText(element, open ? `${open} · ${text}` : text);
}

function asked(question, tag = "legend") {
  const optional = question.optional ? make("span", { className: "optional" }, " (optional)") : null;
  return make(tag, { className: "ask", id: `ask-${question.id}` }, question.text, optional);
}

function textQuestion(question, answered, context) {
  const left = context.draft.read();
  const area = make("textarea", { rows: 3, "aria-labelledby": `ask-${question.id}`, value: left ?? answered ?? "" });
  // Not asked of the draft, which a full device does not keep.
  let written = left !== null;
  let timer = null;
  const given = () => {
    clearTimeout(timer);
    if (!written) return;
    const text = area.value.trim();
    const from = context.draft.take();
    if (text === "") context.partly(answered ? "The earlier answer stays until you write another." : "");
    else context.give(text, null, from);
    written = false;
  };
  area.addEventListener("input", () => {
    written = true;
    context.draft.write(area.value);
    context.partly("Writing…");
    clearTimeout(timer);
    timer = setTimeout(given, TYPING_PAUSE_MS);
  });
  area.addEventListener("change", given);
  area.give = given;
  if (written) timer = setTimeout(given, TYPING_PAUSE_MS);
  const take = (value) => {
    const free = !written && document.activeElement !== area && area.value.trim() !== value;
    if (free) area.value = value;
    return free;
  };
  return { nodes: [asked(question), area], take };
}

function likertQuestion(question, answered, context) {
  const points = scale(question.id, question, answered, context.give);
  return { nodes: [asked(question), points], take: (value) => check(points, value) };
}

/** Checks the button of `value`; whether it was another before. */
function check(points, value) {
  const button = points.querySelector(`input[value="${value}"]`);
  const news = button !== null && !button.checked;
  if (news) button.checked = true;
  return news;
}

/** Radio buttons 1..=points with what the ends mean. */
function scale(name, { points, low, high }, chosen, give) {
  // Room for the mark is kept, so that nothing moves when it comes or goes.
  const gap = make("span", { className: "gap" }, "Not answered yet");
  const ends = make("div", { className: "ends" }, make("span", { "aria-hidden": "true" }, low), gap, make("span", { "aria-hidden": "true" }, high));
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
  const points = [...(answered ?? Array(SUS_ITEMS.length).fill(0))];
  const open = () => {
    const given = points.filter((point) => point > 0).length;
    return given < points.length ? `${given} of ${points.length} answered` : null;
  };
  const scales = SUS_ITEMS.map((_, index) => {
    const ends = { points: 5, low: "Strongly disagree", high: "Strongly agree" };
    // Each item goes by itself, so that it takes back nothing that another device has given.
    const choose = (value) => {
      points[index] = value;
      items[index].classList.remove("wanting");
      context.give(points.map((_, place) => (place === index ? value : 0)), index);
    };
    return scale(`${question.id}-${index}`, ends, points[index], choose);
  });
  const take = (value) => {
    points.splice(0, points.length, ...value);
    items.forEach((item, index) => points[index] > 0 && item.classList.remove("wanting"));
    return scales.map((each, index) => check(each, value[index])).some(Boolean);
  };
  const items = SUS_ITEMS.map((text, index) => make("fieldset", {}, make("legend", {}, `${index + 1}. ${text}`), scales[index]));
  const gaps = () => items.filter((_, index) => points[index] === 0);
  return { nodes: [asked(question), make("div", { className: "sus" }, ...items)], take, open, gaps };
}

function rankingQuestion(question, answered, context) {
  // An order counts once it is confirmed as a whole: one tap on an arrow says nothing of the other settings.
  const arranged = context.draft.read();
  const order = arranged ?? (answered ? [...answered] : Array.from({ length: context.settings }, (_, index) => index + 1));
  const list = make("ol", { className: "ranking" });
  const heard = make("p", { className: "visually-hidden", "aria-live": "polite" });
  const confirm = make("button", { type: "button", className: "confirm", hidden: answered !== undefined && arranged === null }, "This order is right");
  const begun = () => (!confirm.hidden && context.draft.read() !== null ? "Kept on this device until you tap “This order is right”" : null);
  confirm.onclick = () => {
    confirm.hidden = true;
    context.draft.write(null);
    context.give([...order]);
  };
  const moved = () => {
    if (confirm.hidden) return context.give([...order]);
    context.draft.write(order);
    context.partly(begun());
  };
  const move = (from, to) => {
    const [setting] = order.splice(from, 1);
    order.splice(to, 0, setting);
    draw();
    const [up, down] = list.children[to].querySelectorAll("button");
    (to < from ? (up.disabled ? down : up) : down.disabled ? up : down).focus();
    setText(heard, `Setting ${setting} is now in place ${to + 1} of ${order.length}`);
    moved();
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
  const take = (value) => {
    if (begun()) return false;
    const news = !confirm.hidden || value.some((setting, index) => setting !== order[index]);
    if (!news) return false;
    confirm.hidden = true;
    order.splice(0, order.length, ...value);
    draw();
    return true;
  };
  return { nodes: [asked(question), list, heard, confirm], take, begun };
}

function place(number) {
  const ending = ["th", "st", "nd", "rd"][number % 10] ?? "th";
  return `${number}${number >= 11 && number <= 13 ? "th" : ending}`;
}
