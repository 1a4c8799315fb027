// The full-screen notice at each change of setting.

import { byId, setText } from "../shared/dom.js";
import { say } from "../shared/language.js";
import { NoticeGuard } from "./notice.js";

/**
 * Calls `accept(segment)` when the surgeon taps the notice of `segment`. A surgeon who is writing in `box` when the
 * notice appears can continue to write there.
 *
 * @param {HTMLTextAreaElement} box
 * @param {(segment: string) => void} accept
 */
export function noticeDialog(box, accept) {
  const dialog = byId("change", HTMLDialogElement);
  const button = byId("change-tap");
  const guard = new NoticeGuard();
  /** @type {string | null} */
  let segment = null;
  let asked = "tap-to-continue";
  /** @type {Element | null} */
  let focusBefore = null;

  document.addEventListener("keydown", onKey, true);
  dialog.addEventListener("cancel", (event) => event.preventDefault());
  // A browser may close the dialog all the same (Escape, a tablet's back gesture). Then it is opened again.
  dialog.addEventListener("close", () => segment !== null && dialog.showModal());

  /** @param {KeyboardEvent} event */
  function onKey(event) {
    const writing = focusBefore === box && box.value !== "";
    const verdict = guard.key(event, performance.now(), { open: dialog.open, writing });
    if (verdict === "pass") return;

    event.preventDefault();
    if (verdict !== "write") return;
    box.setRangeText(event.key, box.selectionStart, box.selectionEnd, "end");
    box.dispatchEvent(new Event("input"));
  }

  button.onclick = ({ detail }) => {
    if (segment === null || !guard.click(performance.now(), detail === 0)) return;
    ask("one-moment");
    accept(segment);
  };

  /** @param {Api.SurgeonView} state */
  function show(state) {
    if (!state.segment) return;
    if (!dialog.open || segment !== state.segment) {
      segment = state.segment;
      asked = "tap-to-continue";
      guard.shown(performance.now());
    }
    drawWords(state);
    if (dialog.open) return;
    focusBefore = document.activeElement;
    dialog.showModal();
    button.focus();
  }

  /** @param {Api.SurgeonView} state */
  function drawWords(state) {
    const change = state.setting === 1 ? say("change-first") : say("change-next");
    setText(byId("change-title"), say("setting-of", { setting: state.setting, settings: state.settings }));
    const look = state.voice ? say("change-say") : say("change-write");
    setText(byId("change-what"), `${change} ${look}`);
    byId("change-practice").hidden = !state.practice;
    setText(byId("change-go"), say(asked));
  }

  function hide() {
    if (!dialog.open) return;
    segment = null;
    dialog.close();
    // What had the focus may be gone. A box that nobody was writing in would open the tablet's keyboard.
    const isWriting = focusBefore === box && box.value !== "";
    const before = focusBefore instanceof HTMLElement && focusBefore !== document.body ? focusBefore : null;
    const isThere = before !== null && before.getClientRects().length > 0;
    if (isThere && (before !== box || isWriting)) before.focus();
    else byId("view").focus({ preventScroll: true });
  }

  /** @param {string} id of the message in which the notice asks for the tap */
  function ask(id) {
    asked = id;
    setText(byId("change-go"), say(asked));
  }

  return { show, hide, ask };
}
