// The page on which a device learns to trust the server.

import { byId, setText } from "../shared/dom.js";
import { judge, kindOf, WORDS } from "./verdict.js";

/** The timeout of a request: a later answer is not expected. */
const PATIENCE_MS = 10_000;

const verdict = byId("check");

/** @param {string} address */
function ask(address) {
  const controller = new AbortController();
  setTimeout(() => controller.abort(), PATIENCE_MS);
  // Without cookies: the answer is the same for everyone.
  return fetch(address, { cache: "no-store", credentials: "omit", signal: controller.signal });
}

async function check() {
  const found = await judge(ask, location.host);
  const { finding, advice } = WORDS[found];
  verdict.dataset.verdict = found;
  setText(verdict, finding);
  setText(byId("check-advice"), advice);
  byId("go-on").hidden = found !== "trusted";
}

byId("check-again").onclick = check;

// The steps lead into the device's settings and back to this page.
document.addEventListener("visibilitychange", () => {
  if (!document.hidden) check();
});

const kind = kindOf(navigator.userAgent, navigator.maxTouchPoints);
byId(`steps-${kind}`, HTMLDetailsElement).open = true;
check();
