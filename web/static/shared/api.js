// Talks JSON with the server, and tells three things apart: it worked, the server refused, nobody answered.

import { setText } from "./dom.js";

/** The server's refusal: `message` is written for people. */
export class Refused extends Error {
  /** `ours`: whether the server itself said so, not a proxy before it. */
  constructor(status, message, ours) {
    super(message);
    this.status = status;
    this.ours = ours;
  }

  /** Whether the same request would be refused again: the server itself found the fault in what was sent. */
  get final() {
    return this.ours && [400, 404, 409, 413, 422].includes(this.status);
  }
}

const PATIENCE_MS = 10000;

/** Half an emoji, which a cut text may end with, is no text to the server: it goes as the mark for what cannot be read. */
const whole = (_, value) => (typeof value === "string" && value.toWellFormed ? value.toWellFormed() : value);

async function request(method, path, body) {
  const response = await fetch(path, {
    method,
    headers: body === undefined ? {} : { "content-type": "application/json" },
    body: body === undefined ? undefined : JSON.stringify(body, whole),
    signal: AbortSignal.timeout(PATIENCE_MS),
    cache: "no-store",
  });
  const text = await response.text();
  if (!response.ok) throw refusal(text, response.status);
  return { status: response.status, body: text ? JSON.parse(text) : null };
}

function refusal(text, status) {
  try {
    const said = JSON.parse(text);
    if (typeof said.error === "string") return new Refused(status, said.error, true);
  } catch {
    // not JSON: a proxy's page or a bare status
  }
  return new Refused(status, explanation(status), false);
}

function explanation(status) {
  if (status === 401 || status === 403) return "This link is no longer valid here. Open it again, or ask for a new one.";
  if (status === 413) return "That is too long to be saved in one piece.";
  if (status < 300) return "What answered is not the server. Check the network that this device is on.";
  return `The server answered with an error (${status}).`;
}

export const get = async (path) => (await request("GET", path)).body;
export const post = async (path, body) => (await request("POST", path, body)).body;

/** Sends what must not be lost: done only once the server itself says, with its 204, that it is on its disk. */
export async function keep(path, body) {
  const { status } = await request("POST", path, body);
  if (status !== 204) throw new Refused(status, explanation(status), false);
}

/** An error in words, whoever made it; `unheard` is for nobody having answered. */
export function inWords(error, unheard = "No connection to the server. Try again in a moment.") {
  return error instanceof Refused ? error.message : unheard;
}

/** Says in `element` why something was not done. */
export function tellTrouble(element, error, unheard) {
  element.toggleAttribute("data-unheard", !(error instanceof Refused));
  setText(element, inWords(error, unheard));
}

/** Takes back what was said of a server that did not answer: it is there again. */
export function heardAgain() {
  for (const element of document.querySelectorAll("[data-unheard]")) {
    element.removeAttribute("data-unheard");
    setText(element, "");
  }
}
