// The card to choose who focuses outside a session: a policy, or the operator with the slider.

import { post } from "../shared/api.js";
import { byId, setText } from "../shared/dom.js";
import { tell, tellTrouble } from "../shared/trouble.js";
import { Orders } from "./orders.js";

export const BY_HAND = "by-hand";

/** The value that the list of policies shows during a session, when nobody may know which policy runs. */
export const UNTOLD = "";

const MIDDLE = 0.5;

const policies = byId("policy", HTMLSelectElement);
const slider = byId("focal-power", HTMLInputElement);
const orders = new Orders(send);

/** @type {Stream.OperatorStatus | null} */
let status = null;
let dragging = false;
/** Whether the slider shows where the lens is. */
let isPlaced = false;

/**
 * Draws the policy and the focal power of the loop's status. During a session both are hidden. While it is paused, and
 * after an abort, the operator can still focus by hand. After a session the focal power stays hidden until somebody has
 * chosen what focuses.
 *
 * @param {Stream.OperatorStatus} next
 * @param {Api.OperatorView | null} session
 */
export function drawFocus(next, session) {
  status = next;
  const { focal_power: power } = next;
  const mayFocus = session === null || session.may_focus_by_hand;
  byId("focus-controls", HTMLFieldSetElement).disabled = !mayFocus;
  byId("focus-card").classList.toggle("wanted", session !== null && mayFocus);
  policies.disabled = session !== null;
  byId("traces-hidden").hidden = session === null && power !== null;
  const until = session === null ? "until you choose what focuses" : "while a session runs";
  setText(byId("traces-hidden"), `Focal path and timing are hidden ${until}.`);
  if (!mayFocus) {
    drawUntold();
    return;
  }
  if (session !== null) {
    drawByHand(session.by_hand ?? null);
    return;
  }
  if (power === null) {
    drawLeft(next);
    return;
  }

  const text = power.toFixed(3);
  setText(byId("focus-now"), `focal power ${text}`);
  if (dragging || orders.busy) return;
  policies.value = next.policy ?? BY_HAND;
  if (next.policy === null && isPlaced) return;
  isPlaced = true;
  slider.value = String(power);
  setText(byId("focal-power-value"), text);
}

/**
 * In a session the slider shows only where the operator put it, not where the policy left the lens.
 *
 * @param {number | null} byHand
 */
function drawByHand(byHand) {
  isPlaced = false;
  setText(byId("focus-now"), "Move the slider to focus by hand.");
  if (dragging || orders.busy) return;
  policies.value = UNTOLD;
  slider.value = String(byHand ?? MIDDLE);
  setText(byId("focal-power-value"), byHand === null ? "" : byHand.toFixed(3));
}

/**
 * After a session the page does not show where its last policy left the lens.
 *
 * @param {Stream.OperatorStatus} next
 */
function drawLeft(next) {
  isPlaced = false;
  setText(byId("focus-now"), "Choose what focuses.");
  if (dragging || orders.busy) return;
  policies.value = next.policy ?? BY_HAND;
  slider.value = String(MIDDLE);
  setText(byId("focal-power-value"), "");
}

/** Clears the values from before the session, which would look like present ones. */
function drawUntold() {
  isPlaced = false;
  setText(byId("focus-now"), "The session controls the focus until you close it.");
  policies.value = UNTOLD;
  slider.value = String(MIDDLE);
  setText(byId("focal-power-value"), "");
}

/** @param {Api.Focus} order */
async function send(order) {
  try {
    await post("/api/operator/focus", order);
    tell(byId("focus-trouble"), "");
  } catch (error) {
    tellTrouble(byId("focus-trouble"), error);
  }
}

slider.addEventListener("input", () => {
  dragging = true;
  const power = Number(slider.value);
  setText(byId("focal-power-value"), power.toFixed(3));
  if (!policies.disabled) policies.value = BY_HAND;
  orders.give({ focal_power: power });
});
slider.addEventListener("change", () => {
  dragging = false;
});

policies.addEventListener("change", () => {
  const policy = policies.value;
  orders.give(policy === BY_HAND ? { focal_power: status?.focal_power ?? MIDDLE } : { policy });
});
