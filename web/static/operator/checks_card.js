// The card that says whether everything is ready for a trial: the server's checks of this machine, its devices and the
// surgeon's tablet.

import { get } from "../shared/api.js";
import { byId, make, redraw, setText } from "../shared/dom.js";
import { tell, tellTrouble } from "../shared/trouble.js";
import { heading, passed, shown, sorted, summary } from "./checks_words.js";
import { Orders } from "./orders.js";

/** @typedef {import("./checks_words.js").Finding} Finding */

/** Several things often change at the same time, such as a tablet that comes and then shows its page. */
const SETTLED_MS = 1000;

const button = byId("check-again", HTMLButtonElement);
/** One check at a time: the answer of an earlier one must not replace that of a later one. @type {Orders<null>} */
const checks = new Orders(check);
/** @type {ReturnType<typeof setTimeout> | undefined} */
let soon;

/** Called after each check with whether something must be put right before a trial. @type {(wrong: boolean) => void} */
let report = () => {};

/** @param {Finding} finding */
function line(finding) {
  const { mark, words, level } = shown(finding);
  return make(
    "li",
    { className: level },
    make("span", { className: "mark", "aria-hidden": "true" }, mark),
    make(
      "div",
      {},
      make("span", { className: "visually-hidden" }, `${words}: `),
      make("strong", {}, `${heading(finding.subject)}:`),
      make("span", {}, ` ${finding.found}`),
      finding.advice && make("p", { className: "muted" }, finding.advice),
    ),
  );
}

/** @param {Finding[]} findings */
function draw(findings) {
  const { open, well } = sorted(findings);
  setText(byId("checks-summary"), summary(findings));
  redraw(byId("checks-open"), open.map(line));
  redraw(byId("checks-well"), well.map(line));
  setText(byId("checks-passed"), passed(well.length));
  byId("checks-details").hidden = well.length === 0;
  report(open.some(({ verdict }) => verdict === "wrong"));
}

async function check() {
  button.disabled = true;
  setText(byId("checks-summary"), "Checking…");
  try {
    draw((await get("/api/operator/checks")).findings);
    tell(byId("checks-trouble"), "");
  } catch (error) {
    setText(byId("checks-summary"), "");
    tellTrouble(byId("checks-trouble"), error);
  } finally {
    button.disabled = false;
  }
}

function checkSoon() {
  clearTimeout(soon);
  soon = setTimeout(() => checks.give(null), SETTLED_MS);
}

/**
 * Runs the checks now, and whenever the operator presses the button. Returns a function that runs them soon, because
 * something has changed.
 *
 * @param {(wrong: boolean) => void} found called with whether something must be put right before a trial
 */
export function followChecks(found) {
  report = found;
  button.addEventListener("click", () => checks.give(null));
  checks.give(null);
  return checkSoon;
}
