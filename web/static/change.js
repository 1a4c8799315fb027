// The full-screen notice at each change of setting. It needs a tap meant for it: one that began before it was there, or
// the second half of a double tap, does not count.

import { byId, setText } from "./dom.js";

const NOT_MEANT_MS = 600;

/** `accept(segment)` is called when the surgeon taps the notice of `segment`. */
export function changeNotice(accept) {
  const dialog = byId("change");
  const button = byId("change-tap");
  let segment = null;
  let shownAt = 0;
  let focusBefore = null;

  dialog.addEventListener("cancel", (event) => event.preventDefault());
  // A browser may close a dialog against that (Escape, a tablet's back gesture): then it comes back.
  dialog.addEventListener("close", () => segment !== null && dialog.showModal());
  button.onclick = () => {
    if (performance.now() - shownAt < NOT_MEANT_MS) return;
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
