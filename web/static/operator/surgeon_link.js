// The surgeon's link, to be copied: in a study it is to the session under way alone.

import { get } from "../shared/api.js";
import { byId, setText } from "../shared/dom.js";
import { tellTrouble } from "../shared/trouble.js";

const TOLD_MS = 2000;

/** The server may have another address by then, as after a change of the network. */
const ASK_AGAIN_MS = 60_000;

export function offerLink() {
  const button = byId("copy-link");
  const link = byId("surgeon-link", HTMLInputElement);

  button.onclick = async () => {
    link.select();
    try {
      await navigator.clipboard.writeText(link.value);
    } catch {
      // The clipboard interface is missing on plain http.
      document.execCommand("copy");
    }
    setText(button, "Copied");
    setTimeout(() => setText(button, "Copy link"), TOLD_MS);
  };
  setInterval(askAgain, ASK_AGAIN_MS);
}

/** Shows the link by the server's present address. */
async function askAgain() {
  if (shownFor === null) return;
  try {
    draw(await get("/api/operator/surgeon-link"));
  } catch {
    // The one that is shown stays until the next time.
  }
}

/** @param {Api.Schemas["SurgeonLink"]} told */
function draw({ link, qr }) {
  const field = byId("surgeon-link", HTMLInputElement);
  // Somebody may be copying the one that is shown.
  if (field.value === link) return;
  field.value = link;
  // The server's own picture, made from the link alone.
  byId("qr").innerHTML = qr;
}

/** What the link was last asked for. @type {string | null} */
let shownFor = null;

/**
 * Shows the link that opens `session`, and the shared one where it is over or outside any study.
 *
 * @param {Api.OperatorView | null} session
 */
export function followLink(session) {
  const linked = session?.study && session.phase !== "completed" && session.phase !== "aborted";
  const wanted = linked ? session.session : "";
  if (wanted === shownFor) return;
  shownFor = wanted;
  showLink(wanted !== "");
}

/** @param {boolean} ofSession whether the link is to be to one session */
async function showLink(ofSession) {
  const trouble = byId("link-trouble");
  try {
    draw(await get("/api/operator/surgeon-link"));
    setText(trouble, "");
  } catch (error) {
    // Asked for again when the session changes, or somebody has signed in.
    shownFor = null;
    byId("surgeon-link", HTMLInputElement).value = "";
    byId("qr").replaceChildren();
    tellTrouble(trouble, error);
  }
  byId("link-session").hidden = !ofSession;
}
