// What the operator sees of the focus outside sessions: whether the patch is held in focus, by what the policy believes,
// and whether it follows the tissue. The server decides both, and sends neither while a session is under way.

import { byId, setText } from "../shared/dom.js";

/** @typedef {Stream.OperatorStatus} Status */

const LOCK_WORDS = {
  held: "In focus",
  searching: "Searching for the focus",
  nothing: "Nothing to tell the focus by",
};

const FOLLOWING_WORDS = {
  screen: "",
  tissue: "",
  lost: "The tissue was lost: it could not be recognised any more. The focus looks at the centre again.",
  left: "The tissue has left the bright circle. The focus looks at the centre again.",
};

/**
 * Draws the sign of `status`, and follows the switch *Follow the tissue*.
 *
 * @param {(follows: boolean) => void} choose called when somebody has moved the switch
 */
export function focusSign(choose) {
  const sign = byId("lock");
  const choice = byId("follow-choice");
  const follow = byId("follow-tissue", HTMLInputElement);
  follow.onchange = () => choose(follow.checked);

  /** @param {Status} status */
  function draw({ lock, following }) {
    sign.hidden = lock === null;
    sign.dataset.lock = lock ?? "";
    setText(byId("lock-words"), lock === null ? "" : LOCK_WORDS[lock]);

    choice.hidden = following === null;
    follow.checked = following !== null && following !== "screen";
    setText(byId("following"), following === null ? "" : FOLLOWING_WORDS[following]);
  }

  return { draw };
}
