// Follows what the server makes in the background, such as an export: asks for its progress until it is finished. The
// page may be closed meanwhile. The server keeps what it has made for a while only, so a page that somebody comes back
// to asks whether it is still there.

import { Refused } from "./api.js";
import { tellTrouble } from "./trouble.js";

/** Time between two requests for the progress. */
const ASK_AGAIN_MS = 1000;

/**
 * Asks for the state, and passes it on to `show`, until it is no longer `running`. If the server does not answer, it is
 * asked again. Returns a function that follows the state with which a start was answered.
 *
 * @template {{ state: string }} State
 * @param {() => Promise<State>} get
 * @param {(state: State) => void} show
 * @param {HTMLElement} trouble says why the server refused to tell
 */
export function followUntilMade(get, show, trouble) {
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer;
  let isReady = false;

  function askSoon() {
    clearTimeout(timer);
    timer = setTimeout(ask, ASK_AGAIN_MS);
  }

  async function ask() {
    try {
      follow(await get());
    } catch (error) {
      tellTrouble(trouble, error);
      // Asked again at once, the server would ask to sign in every second.
      if (!(error instanceof Refused)) askSoon();
    }
  }

  /** @param {State} state */
  function follow(state) {
    show(state);
    isReady = state.state === "ready";
    if (state.state === "running") askSoon();
  }

  document.addEventListener("signed-in", ask);
  document.addEventListener("visibilitychange", () => {
    if (isReady && !document.hidden) ask();
  });
  ask();
  return follow;
}
