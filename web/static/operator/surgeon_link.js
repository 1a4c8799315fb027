// Shows the surgeon's link, to be copied. In a study the link opens only the session under way.

import { get } from "../shared/api.js";
import { copyOnPress } from "../shared/copy.js";
import { byId } from "../shared/dom.js";
import { tell, tellTrouble } from "../shared/trouble.js";
import { isOver } from "./session_words.js";

/** How often the link is asked for again. The server's address may change, for example with the network. */
const ASK_AGAIN_MS = 60_000;

export function offerLink() {
  const button = byId("copy-link", HTMLButtonElement);
  const link = byId("surgeon-link", HTMLInputElement);

  copyOnPress(button, link);
  setInterval(askAgain, ASK_AGAIN_MS);
}

/** Updates the link to the server's present address. */
async function askAgain() {
  const wanted = shownFor;
  if (wanted === null) return;
  try {
    const answer = await get("/api/operator/surgeon-link");
    if (wanted === shownFor) draw(answer);
  } catch {
    // The shown link stays until the next attempt.
  }
}

/** @param {Api.Schemas["SurgeonLink"]} answer */
function draw({ link, qr }) {
  const field = byId("surgeon-link", HTMLInputElement);
  // Somebody may be copying the link that is shown.
  if (field.value === link) return;
  field.value = link;
  // The server's own picture, made from the link alone.
  byId("qr").innerHTML = qr;
}

/** The session that the link opens; "" for the shared link; null if it must be asked for. @type {string | null} */
let shownFor = null;

/**
 * Shows the link that opens `session`, or the shared link if the session is over or outside any study.
 *
 * @param {Api.OperatorView | null} session
 */
export function followLink(session) {
  const linked = session?.study && !isOver(session);
  const wanted = linked ? session.session : "";
  if (wanted === shownFor) return;
  shownFor = wanted;
  showLink(wanted);
}

/**
 * Asks for the link, and shows it unless another is wanted by the time the answer comes.
 *
 * @param {string} wanted the session that the link opens, or "" for the shared link
 */
async function showLink(wanted) {
  const trouble = byId("link-trouble");
  try {
    const answer = await get("/api/operator/surgeon-link");
    if (wanted !== shownFor) return;
    draw(answer);
    tell(trouble, "");
  } catch (error) {
    if (wanted !== shownFor) return;
    // The link is asked for again when the session changes, or when somebody has signed in.
    shownFor = null;
    byId("surgeon-link", HTMLInputElement).value = "";
    byId("qr").replaceChildren();
    tellTrouble(trouble, error);
  }
  byId("link-session").hidden = wanted === "";
}
