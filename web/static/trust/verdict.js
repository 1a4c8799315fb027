// Finds out whether this device trusts the server. Does not use the DOM.

/** @typedef {"trusted" | "not-trusted" | "unreachable"} Verdict */

/**
 * Asks the server over TLS. A browser refuses the answer of a server that it does not trust, and does not say why. So
 * if no answer comes, the same question is asked the way the page itself was loaded. If the server answers there, it is
 * reachable but not trusted.
 *
 * @param {(address: string) => Promise<unknown>} ask rejects if no answer comes
 * @param {string} host host and port of the server
 * @returns {Promise<Verdict>}
 */
export async function judge(ask, host) {
  try {
    await ask(`https://${host}/trust/check`);
    return "trusted";
  } catch {
    // Not trusted or not reachable: the next request shows which.
  }

  try {
    await ask("/trust/check");
    return "not-trusted";
  } catch {
    return "unreachable";
  }
}

/**
 * The kind of device. It decides which steps are opened first.
 *
 * @param {string} agent the browser's user agent
 * @param {number} touches how many fingers the screen can follow at once. An iPad says that it is a Mac, but follows
 *   more than one.
 * @returns {"apple" | "android" | "windows" | "mac" | "linux"}
 */
export function kindOf(agent, touches) {
  if (/iPad|iPhone/.test(agent)) return "apple";
  if (/Macintosh/.test(agent)) return touches > 1 ? "apple" : "mac";
  if (/Android/.test(agent)) return "android";
  if (/Windows/.test(agent)) return "windows";
  return "linux";
}

/** @type {Record<Verdict, {finding: string, advice: string}>} */
export const WORDS = {
  trusted: {
    finding: "Yes, this device trusts the server.",
    advice:
      "If somebody went past the browser’s warning on this device before, close the browser and check again.",
  },
  "not-trusted": {
    finding: "Not yet.",
    advice: "Follow the steps for this device below. This page checks again when you come back to it.",
  },
  unreachable: {
    finding: "The server does not answer.",
    advice: "Check that this device is on the server’s network, and that the server runs.",
  },
};
