// What is tried on a tablet, in words.

/** @typedef {Api.Schemas["TabletPart"]} Part */
/** @typedef {{ part: Part, works: boolean }} Tried */

/** @type {Record<Part, { name: string, advice: string }>} */
export const PARTS = {
  encrypted: {
    name: "Encrypted connection",
    advice: "open the page by https, or voice and opening without a network do not work",
  },
  storage: {
    name: "Storage for comments",
    advice: "leave private browsing, or make room on the tablet: a reload would lose comments",
  },
  disk: {
    name: "Storage for voice",
    advice: "leave private browsing, or make room on the tablet: recordings would be lost at a reload",
  },
  stream: {
    name: "Live connection",
    advice: "the network does not let WebSocket connections through; use another one",
  },
  picture: {
    name: "Drawing pictures",
    advice: "this browser is too old: iPadOS 16.4, Chrome 108, Firefox 121 or newer",
  },
  microphone: {
    name: "Microphone",
    advice: "allow it for this page in the browser’s settings; without it comments can be typed",
  },
  "screen-on": {
    name: "Keeping the screen on",
    advice: "set the tablet so that its screen stays on",
  },
};

/** What a trial cannot do without. @type {Part[]} */
const NEEDED = ["storage", "stream", "picture"];

/** @param {Tried[]} tried */
export function summary(tried) {
  const missing = tried.filter(({ works }) => !works).map(({ part }) => part);
  if (missing.length === 0) return "Everything works on this tablet.";
  if (missing.some((part) => NEEDED.includes(part))) return "This tablet is not fit for a trial as it is.";
  return "A trial can run on this tablet. Look at what does not work.";
}
