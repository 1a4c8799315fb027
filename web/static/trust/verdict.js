// Whether this device trusts the server. Without the DOM.

/** @typedef {"trusted" | "not-trusted" | "unreachable"} Verdict */

/**
 * Asks the server over TLS. A browser refuses the answer of a server that it does not trust, and does not say why. So
 * where the answer fails, the same is asked as the page itself came: a server that answers there can be reached.
 *
 * @param {(address: string) => Promise<unknown>} ask fails where no answer comes
 * @param {string} host host and port of the server
 * @returns {Promise<Verdict>}
 */
export async function judge(ask, host) {
  try {
    await ask(`https://${host}/trust/check`);
    return "trusted";
  } catch {
    // Not trusted, or not there: the next question tells.
  }

  try {
    await ask("/trust/check");
    return "not-trusted";
  } catch {
    return "unreachable";
  }
}

/**
 * The kind of device, for the steps to open first.
 *
 * @param {string} agent what the browser says of itself
 * @param {number} touches how many fingers the screen tells apart: an iPad says that it is a Mac
 * @returns {"apple" | "android" | "windows" | "mac" | "linux"}
 */
export function kindOf(agent, touches) {
  if (/iPad|iPhone/.test(agent)) return "apple";
  if (/Macintosh/.test(agent)) return touches > 1 ? "apple" : "mac";
  if (/Android/.test(agent)) return "android";
  if (/Windows/.test(agent)) return "windows";
  return "linux";
}

/** @type {Record<Verdict, {said: string, advice: string}>} */
export const WORDS = {
  trusted: {
    said: "Yes, this device trusts the server.",
    advice:
      "If somebody went past the browser’s warning on this device before, close the browser and check again.",
  },
  "not-trusted": {
    said: "Not yet.",
    advice: "Follow the steps for this device below. This page checks again when you come back to it.",
  },
  unreachable: {
    said: "The server does not answer.",
    advice: "Check that this device is on the server’s network, and that the server runs.",
  },
};
