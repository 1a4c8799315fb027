// Says the pages' messages in one language. The messages lie in `web/languages/`, one file a language, in Mozilla's
// format Fluent. The server makes a script of each, which every page loads for its own language before its other
// scripts.

import { FluentBundle } from "../fluent/bundle.js";
import { FluentResource } from "../fluent/resource.js";

const ENGLISH = "en";

/** Begin and end of words that may be written in another direction than the sentence (Unicode's first strong isolate). */
const ISOLATED = ["\u2068", "\u2069"];

/** Letters that are written from right to left. */
const RIGHT_TO_LEFT = /[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc]/u;

/** The text of each language's file that was loaded: its script puts it there. */
globalThis.parfocalLanguages ??= {};
const texts = globalThis.parfocalLanguages;

/**
 * @param {string} code
 * @returns {import("@fluent/bundle").FluentBundle}
 */
function bundleOf(code) {
  /** @type {any} */
  const bundle = new FluentBundle(code, { useIsolating: false });
  bundle.addResource(new FluentResource(texts[code] ?? ""));
  return bundle;
}

const ofPage = globalThis.document?.documentElement?.lang ?? ENGLISH;
/** The page's own language at first, so that whatever is said while the page is built is in it. */
let spoken = knows(ofPage) ? ofPage : ENGLISH;
let bundle = bundleOf(spoken);

/** The code of the language that is spoken. */
export function language() {
  return spoken;
}

/**
 * Whether the language's script was loaded.
 *
 * @param {string} code
 */
export function knows(code) {
  return Object.hasOwn(texts, code);
}

/**
 * Speaks a language from now on. Returns whether that changes anything: a language that is not known changes nothing.
 *
 * @param {string} code
 */
export function speak(code) {
  if (code === spoken || !knows(code)) return false;
  spoken = code;
  bundle = bundleOf(code);
  return true;
}

/**
 * Words of people as the argument of a message.
 *
 * @param {string} text
 */
export function words(text) {
  return RIGHT_TO_LEFT.test(text) ? `${ISOLATED[0]}${text}${ISOLATED[1]}` : text;
}

/** @typedef {Record<string, string | number>} Arguments */

/**
 * The message `id`.
 *
 * @param {string} id
 * @param {Arguments} [args]
 */
export function say(id, args) {
  return format(id, bundle.getMessage(id)?.value, args);
}

/**
 * An attribute of the message `id`.
 *
 * @param {string} id
 * @param {string} name
 */
export function sayAttribute(id, name) {
  return format(id, bundle.getMessage(id)?.attributes[name]);
}

/**
 * The names of the attributes that message `id` sets on an element, and whether it has a text of its own.
 *
 * @param {string} id
 */
export function partsOf(id) {
  const message = bundle.getMessage(id);
  return { hasText: message?.value != null, attributes: Object.keys(message?.attributes ?? {}) };
}

/**
 * @param {string} id shown if the message is missing, which a test rules out
 * @param {Parameters<import("@fluent/bundle").FluentBundle["formatPattern"]>[0] | null | undefined} pattern
 * @param {Arguments} [args]
 */
function format(id, pattern, args) {
  return pattern == null ? id : bundle.formatPattern(pattern, args ?? null, []);
}
