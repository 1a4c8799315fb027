// The full-screen notice at each change of setting. It needs a tap meant for it: one that began before it was there, or
// the second half of a double tap, does not count.

import { byId, setText } from "../shared/dom.js";

const NOT_MEANT_MS = 600;
/** A key this soon after another belongs to what was being typed. */
const TYPING_MS = 600;

/**
 * `accept(segment)` is called when the surgeon taps the notice of `segment`. Who is writing in `box` when it appears goes on
 * writing there: keys that are not meant for the notice do not accept it.
 */
export function changeNotice(box, accept) {
  const dialog = byId("change");
  const button = byId("change-tap");
  let segment = null;
  let shownAt = 0;
  let focusBefore = null;
  let keyAt = -Infinity;
  let typedAt = -Infinity;

  document.addEventListener("keydown", (event) => {
    const now = performance.now();
    const typing = event.repeat || now - keyAt < TYPING_MS || now - shownAt < NOT_MEANT_MS;
    keyAt = now;
    if (!dialog.open) return;
    const letter = event.key.length === 1 && !event.ctrlKey && !event.metaKey && !event.altKey;
    const writing = focusBefore === box && box.value !== "";
    if (event.key === "Enter" ? !typing : !letter || (!typing && !writing)) return;
    event.preventDefault();
    typedAt = now;
    if (!letter || !writing) return;
    box.setRangeText(event.key, box.selectionStart, box.selectionEnd, "end");
    box.dispatchEvent(new Event("input"));
  }, true);
  dialog.addEventListener("cancel", (event) => event.preventDefault());
  // A browser may close a dialog against that (Escape, a tablet's back gesture): then it comes back.
  dialog.addEventListener("close", () => segment !== null && dialog.showModal());
  button.onclick = ({ detail }) => {
    const now = performance.now();
    // Some browsers take a space's release for a click, whatever became of its press.
    if (now - shownAt < NOT_MEANT_MS || (detail === 0 && now - typedAt < TYPING_MS)) return;
    setText(byId("change-go"), "One moment…");
    accept(segment);
  };

  function show(state) {
    if (dialog.open && segment === state.segment) return;
    segment = state.segment;
    shownAt = performance.now();
    setText(byId("change-title"), `Setting ${state.setting} of ${state.settings}`);
    setText(byId("change-what"), `${state.setting === 1 ? "This is the first setting." : "The setting has changed."} Look around as you would in surgery, and write down what you notice.`);
    ask("Tap to continue");
    byId("change-practice").hidden = !state.practice;
    if (dialog.open) return;
    focusBefore = document.activeElement;
    dialog.showModal();
    button.focus();
  }

  function hide() {
    if (!dialog.open) return;
    segment = null;
    dialog.close();
    if (focusBefore?.isConnected) focusBefore.focus();
  }

  /** Asks (again) for the tap. */
  const ask = (text) => setText(byId("change-go"), text);
  return { show, hide, ask };
}
