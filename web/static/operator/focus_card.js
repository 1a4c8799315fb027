// Who focuses outside a session: a policy, or the operator's hand on the slider.

import { post, tellTrouble } from "../shared/api.js";
import { byId, setText } from "../shared/dom.js";

export const BY_HAND = "by-hand";
/** What the list of policies shows while nobody is told which one runs. */
export const UNTOLD = "";

let status = null;
let dragging = false;
let ordered = null;
let ordering = false;

/** Draws what `next`, the loop's status, tells of the focus: during a session, `blinded`, nothing. */
export function drawFocus(next, blinded) {
  status = next;
  // The status that tells again comes after the word that the session is closed.
  const untold = blinded || status.focal_power === null;
  const wasUntold = byId("policy").value === UNTOLD;
  byId("focus-controls").disabled = untold;
  byId("traces-hidden").hidden = !untold;
  if (untold) return drawUntold();
  const power = status.focal_power.toFixed(3);
  setText(byId("focus-now"), `focal power ${power}`);
  if (dragging || ordering) return;
  byId("policy").value = status.policy ?? BY_HAND;
  if (status.policy === null && !wasUntold) return;
  byId("focal-power").value = status.focal_power;
  setText(byId("focal-power-value"), power);
}

/** Nothing of before the session stays, which would look as if it held now. */
function drawUntold() {
  setText(byId("focus-now"), "The session decides until it is closed.");
  byId("policy").value = UNTOLD;
  byId("focal-power").value = 0.5;
  setText(byId("focal-power-value"), "");
}

/** One order at a time, so that the last one given is the last to arrive; those overtaken meanwhile are left out. */
async function focus(order) {
  ordered = order;
  if (ordering) return;
  ordering = true;
  while (ordered) {
    const next = ordered;
    ordered = null;
    try {
      await post("/api/operator/focus", next);
      setText(byId("focus-trouble"), "");
    } catch (error) {
      tellTrouble(byId("focus-trouble"), error);
    }
  }
  ordering = false;
}

const slider = byId("focal-power");
slider.addEventListener("input", () => {
  dragging = true;
  setText(byId("focal-power-value"), Number(slider.value).toFixed(3));
  byId("policy").value = BY_HAND;
  focus({ focal_power: Number(slider.value) });
});
slider.addEventListener("change", () => (dragging = false));
byId("policy").addEventListener("change", () => {
  const policy = byId("policy").value;
  focus(policy === BY_HAND ? { focal_power: status?.focal_power ?? 0.5 } : { policy });
});
