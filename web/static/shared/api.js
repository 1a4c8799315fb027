// Sends JSON to the server, and distinguishes three outcomes: success, a refusal by the server, no answer.

import { say } from "./language.js";

/** A request that the server refused. Its message is written for people. */
export class Refused extends Error {
  /**
   * @param {number} status
   * @param {string} message
   * @param {boolean} ours whether the server itself refused, and not a proxy in front of it
   * @param {boolean} [needsSignIn] whether signing in would help
   */
  constructor(status, message, ours, needsSignIn = false) {
    super(message);
    this.status = status;
    this.ours = ours;
    this.needsSignIn = needsSignIn;
  }

  /**
   * Whether the same request would be refused again, because the server itself found a fault in it.
   */
  get final() {
    return this.ours && [400, 404, 409, 413, 422].includes(this.status);
  }
}

/** Called when the server requires somebody to sign in. @type {(isDeed: boolean) => void} */
let signInNeeded = () => {};

/**
 * Calls `ask` when the server refuses because nobody with the right to do this is signed in.
 *
 * @param {(isDeed: boolean) => void} ask `isDeed`: somebody wanted to do something. Otherwise the page may have asked by
 *   itself.
 */
export function onSignInNeeded(ask) {
  signInNeeded = ask;
}

/** The timeout of a request. Longer than the server's delay after failed attempts to sign in. */
const PATIENCE_MS = 12000;

/**
 * A text that was cut may end with half an emoji, which JSON cannot carry. The half is sent as the replacement
 * character.
 *
 * @param {string} _name
 * @param {unknown} value
 */
function wellFormed(_name, value) {
  // Older browsers lack the method. The server then refuses the text, and the text goes back into its box.
  return typeof value === "string" ? (value.toWellFormed?.() ?? value) : value;
}

/**
 * @param {"GET" | "POST"} method
 * @param {string} path
 * @param {unknown} [body]
 */
function request(method, path, body) {
  if (body === undefined) return ask(path, { method });
  const headers = { "content-type": "application/json" };
  return ask(path, { method, headers, body: JSON.stringify(body, wellFormed) });
}

/**
 * Runs `request` with a signal that ends it after a while, or when `other` does. Tablets that are
 * still in use lack the signals that could be combined for this.
 *
 * @template Answer
 * @param {(signal: AbortSignal) => Promise<Answer>} request
 * @param {AbortSignal} [other]
 */
async function withPatience(request, other) {
  const controller = new AbortController();
  const abort = () => controller.abort();
  const timer = setTimeout(abort, PATIENCE_MS);
  other?.addEventListener("abort", abort);
  if (other?.aborted) abort();
  try {
    return await request(controller.signal);
  } finally {
    clearTimeout(timer);
    other?.removeEventListener("abort", abort);
  }
}

/**
 * @param {string} path
 * @param {RequestInit} asked
 * @returns {Promise<{ status: number, body: any }>}
 */
function ask(path, asked) {
  return withPatience(async (signal) => {
    const response = await fetch(path, { ...asked, signal, cache: "no-store" });
    const text = await response.text();
    if (!response.ok) throw refusal(text, response.status, asked.method !== "GET");
    return { status: response.status, body: text ? JSON.parse(text) : null };
  });
}

/**
 * @param {string} text
 * @param {number} status
 * @param {boolean} isDeed whether the request was to change something
 */
function refusal(text, status, isDeed) {
  try {
    const answer = JSON.parse(text);
    const needsSignIn = answer.sign_in === true;
    if (needsSignIn) signInNeeded(isDeed);
    if (typeof answer.error === "string") return new Refused(status, answer.error, true, needsSignIn);
  } catch {
    // Not JSON: a proxy's page, or a bare status.
  }
  return new Refused(status, explanation(status), false);
}

/** @param {number} status */
function explanation(status) {
  if (status === 401 || status === 403) {
    return say("link-refused");
  }
  if (status === 413) return say("text-too-long");
  if (status < 300) return say("other-answered");
  return say("server-error", { status: String(status) });
}

/**
 * @param {string} path
 * @param {Record<string, string>} names the value of each `{name}` in the path
 */
function fill(path, names) {
  return path.replace(/\{(\w+)\}/g, (_, name) => encodeURIComponent(names[name] ?? ""));
}

/**
 * Gets the JSON at `path`.
 *
 * @template {Api.GetPath} Path
 * @param {Path} path
 * @param {Record<string, string>} [names]
 * @param {Record<string, string>} [query]
 * @returns {Promise<Api.Got<Path>>}
 */
export async function get(path, names = {}, query) {
  const address = fill(path, names);
  return (await request("GET", query ? `${address}?${new URLSearchParams(query)}` : address)).body;
}

/**
 * Gets the picture at `path`.
 *
 * @param {string} path
 * @param {Record<string, string>} names the value of each `{name}` in the path
 * @param {Record<string, string>} query
 * @param {AbortSignal} signal ends the request when it is no longer needed
 */
export function getPicture(path, names, query, signal) {
  const address = `${fill(path, names)}?${new URLSearchParams(query)}`;
  return withPatience(async (ending) => {
    const response = await fetch(address, { signal: ending, cache: "no-store" });
    if (!response.ok) throw refusal(await response.text(), response.status, false);
    return response.blob();
  }, signal);
}

/**
 * Posts `body`, and returns the answer.
 *
 * @template {Api.PostPath} Path
 * @param {Path} path
 * @param {Api.Sent<Path>} body
 * @param {Record<string, string>} [names]
 * @returns {Promise<Api.Answered<Path>>}
 */
export async function post(path, body, names = {}) {
  return (await request("POST", fill(path, names), body)).body;
}

/**
 * Sends data that must not be lost. Only the server's own status 204 confirms that it is on the disk.
 *
 * @param {string} path
 * @param {unknown} body
 */
export async function keep(path, body) {
  const { status } = await request("POST", path, body);
  if (status !== 204) throw new Refused(status, explanation(status), false);
}

/**
 * Sends a piece of sound that must not be lost. Only the server's own status 204 confirms that it is on the disk.
 *
 * @param {string} path
 * @param {ArrayBuffer} audio
 * @param {string} type
 */
export async function keepAudio(path, audio, type) {
  const { status } = await ask(path, { method: "POST", headers: { "content-type": type }, body: audio });
  if (status !== 204) throw new Refused(status, explanation(status), false);
}

/**
 * The text to show for an error.
 *
 * @param {unknown} error
 * @param {string} [noAnswer] the text if the server did not answer
 */
export function inWords(error, noAnswer = say("server-silent")) {
  return error instanceof Refused ? error.message : noAnswer;
}
