// What surgeons read is complete in every language, and nothing of it stands in a template or script.

import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";

import { parse, Visitor } from "@fluent/syntax";
import ts from "typescript";

import { language, say, sayAttribute, speak, words } from "../static/shared/language.js";

const ROOT = new URL("../../", import.meta.url);
const CODES = ["en", "de", "fr", "es"];

/** Templates that only surgeons see, or that surgeons see too. */
const TEMPLATES = ["surgeon.html", "surgeon_over.html", "tablet.html", "error.html", "about_said.html"];

/** Scripts of the pages that surgeons see. What they import belongs to them. */
const SCRIPTS = ["surgeon/page.js", "surgeon/over.js", "tablet/page.js"];

/** Texts in those scripts that nobody reads: names that browsers, servers and files give to things. */
const NAMES = new Set([
  "AbortError",
  "ArrowDown",
  "ArrowLeft",
  "ArrowRight",
  "ArrowUp",
  "End",
  "Enter",
  "Escape",
  "GET",
  "Home",
  "NotAllowedError",
  "NotFoundError",
  "NotReadableError",
  "OverconstrainedError",
  "POST",
  "PageDown",
  "PageUp",
  "SecurityError",
  "Shift",
  "under way",
]);

/** @param {string} path */
const read = (path) => readFileSync(new URL(path, ROOT), "utf8");

/**
 * A language's messages: the values that each is shown with, by the name of the message and of its attributes. A value
 * that only chooses between forms of a word is not shown.
 *
 * @param {string} text
 */
function messages(text) {
  const found = new Map();
  for (const entry of parse(text, {}).body) {
    assert.notEqual(entry.type, "Junk", `not Fluent: ${"content" in entry ? entry.content : ""}`);
    if (entry.type !== "Message") continue;
    const id = entry.id.name;
    assert(!found.has(id), `${id} stands there twice`);
    if (entry.value) found.set(id, shown(entry.value));
    for (const { id: name, value } of entry.attributes) found.set(`${id}.${name.name}`, shown(value));
  }
  return found;
}

/** @param {import("@fluent/syntax").Pattern} pattern */
function shown(pattern) {
  /** @type {Set<string>} */
  const values = new Set();
  class Placeables extends Visitor {
    /** @override @param {import("@fluent/syntax").SelectExpression} select */
    visitSelectExpression(select) {
      // Its first part only chooses, unless a variant shows it.
      for (const variant of select.variants) this.visit(variant);
    }
    /** @override @param {import("@fluent/syntax").VariableReference} variable */
    visitVariableReference({ id }) {
      values.add(`$${id.name}`);
    }
    /** @override @param {import("@fluent/syntax").MessageReference} message */
    visitMessageReference({ id }) {
      values.add(id.name);
    }
  }
  new Placeables().visit(pattern);
  return [...values].sort();
}

/** Number of things may be a word: "one question". @param {string[]} values */
const withoutCount = (values) => values.filter((value) => value !== "$count" && value !== "$settings");

const english = messages(read("web/languages/en.ftl"));

for (const code of CODES.slice(1)) {
  test(`${code} has the same messages as English, and each shows the same values`, () => {
    const other = messages(read(`web/languages/${code}.ftl`));
    assert.deepEqual([...other.keys()], [...english.keys()]);
    for (const [id, values] of english) {
      assert.deepEqual(withoutCount(other.get(id)), withoutCount(values), `${code}: ${id}`);
    }
  });
}

test("there is a file for each language, and no other", () => {
  const files = readdirSync(new URL("web/languages/", ROOT)).sort();
  assert.deepEqual(files, CODES.map((code) => `${code}.ftl`).sort());
});

/**
 * Those scripts and all that they import, with their syntax trees.
 *
 * @returns {Map<string, ts.SourceFile>}
 */
function scripts() {
  const found = new Map();
  const open = [...SCRIPTS];
  for (let name = open.pop(); name !== undefined; name = open.pop()) {
    if (found.has(name) || name.startsWith("fluent/") || name.startsWith("languages/")) continue;
    const text = read(`web/static/${name}`);
    found.set(name, ts.createSourceFile(name, text, ts.ScriptTarget.Latest, true, ts.ScriptKind.JS));
    const base = new URL(name, "file:///");
    for (const [, path] of text.matchAll(/^(?:import|\}) .*?from "([^"]+)";$|^import "([^"]+)";$/gm)) {
      if (path) open.push(new URL(path, base).pathname.slice(1));
    }
  }
  return found;
}

/**
 * Calls `visit` for every text in a script, with the node that it stands in.
 *
 * @param {ts.Node} node
 * @param {(text: string, node: ts.Node) => void} visit
 */
function texts(node, visit) {
  if (ts.isImportDeclaration(node)) return;
  if (ts.isStringLiteral(node) || ts.isNoSubstitutionTemplateLiteral(node)) visit(node.text, node);
  if (ts.isTemplateExpression(node)) {
    const parts = [node.head.text, ...node.templateSpans.map(({ literal }) => literal.text)];
    visit(parts.join("…"), node);
  }
  ts.forEachChild(node, (child) => texts(child, visit));
}

/** Whether a text looks like words for people: two words, or one that begins with a capital. @param {string} text */
function isProse(text) {
  return /\p{L}{2,}[,.:;…]? \p{L}{2,}/u.test(text) || /(?:^|[\s“])\p{Lu}\p{Ll}+/u.test(text);
}

/**
 * Whether nobody reads the text: it is thrown for programmers, chooses elements, or names classes.
 *
 * @param {ts.Node} node
 */
function isForPrograms(node) {
  const { parent } = node;
  if (ts.isNewExpression(parent)) return parent.expression.getText() === "Error";
  if (ts.isCallExpression(parent)) {
    const called = parent.expression.getText();
    return (
      /(?:^console\.warn|querySelector(?:All)?|matches|closest|card|matchMedia|get|post)$/.test(called) &&
      parent.arguments[0] === node
    );
  }
  if (ts.isPropertyAssignment(parent)) return parent.name.getText() === "className";
  return ts.isBinaryExpression(parent) && parent.left.getText().endsWith("className");
}

test("no text for surgeons stands in a script", () => {
  /** @type {string[]} */
  const found = [];
  for (const [name, source] of scripts()) {
    texts(source, (text, node) => {
      if (!isProse(text) || NAMES.has(text) || isForPrograms(node)) return;
      const { line } = source.getLineAndCharacterOfPosition(node.getStart());
      found.push(`${name}:${line + 1}: ${text}`);
    });
  }
  assert.deepEqual(found, [], "put it into web/languages/ and say() it");
});

test("no text for surgeons stands in a template", () => {
  /** @type {string[]} */
  const found = [];
  for (const name of TEMPLATES) {
    const markup = read(`web/templates/${name}`)
      .replace(/<script[\s\S]*?<\/script>/g, "")
      .replace(/\{%[\s\S]*?%\}|\{\{[\s\S]*?\}\}/g, "");
    for (const [, attribute, text] of markup.matchAll(
      / (aria-label|placeholder|title|alt)="([^"]*\p{L}[^"]*)"/gu,
    )) {
      found.push(`${name}: ${attribute}="${text}"`);
    }
    // A block of a template that stands in a tag leaves its attributes.
    const said = markup.replace(/<[^>]*>/g, "\n").replace(/^lang="" dir=""$/gm, "");
    for (const text of said.split("\n")) {
      if (/\p{L}/u.test(text) && text.trim() !== "· parfocal") {
        found.push(`${name}: ${text.trim()}`);
      }
    }
  }
  assert.deepEqual(found, [], "put it into web/languages/ and name it by data-l10n-id");
});

/** Every name of a message in the templates, scripts and the server's code, as it is written there. */
function named() {
  const quoted = new Set();
  const said = new Set();
  for (const [, source] of scripts()) {
    texts(source, (text, node) => {
      quoted.add(text);
      const { parent } = node;
      if (
        ts.isCallExpression(parent) &&
        /^say(Attribute)?$/.test(parent.expression.getText()) &&
        parent.arguments[0] === node
      ) {
        said.add(text);
      }
    });
  }
  for (const name of readdirSync(new URL("web/templates/", ROOT))) {
    const template = read(`web/templates/${name}`);
    for (const [, id] of template.matchAll(/data-l10n-id="([^"]+)"/g)) said.add(id);
    for (const [, id] of template.matchAll(/language\.say\("([^"]+)"\)/g)) said.add(id);
  }
  for (const name of readdirSync(new URL("server/", ROOT), { recursive: true, encoding: "utf8" })) {
    if (!name.endsWith(".rs") || name.startsWith("language/")) continue;
    const code = read(`server/${name}`);
    for (const [, id] of code.matchAll(
      /(?:Message::new|not_now|language\.say|not_inspecting)\((?:state, )?"([^"]+)"/g,
    ))
      said.add(id);
    for (const [, id] of code.matchAll(/"((?:recognised|error)-[a-z-]+)"/g)) quoted.add(id);
  }
  return { quoted, said };
}

test("every message that is said exists, and every message is said somewhere", () => {
  const { quoted, said } = named();
  const ids = new Set([...english.keys()].map((id) => id.split(".")[0] ?? ""));
  assert.deepEqual(
    [...said].filter((id) => !ids.has(id)),
    [],
    "said, but in no language",
  );
  const within = [...english.values()].flat();
  assert.deepEqual(
    [...ids].filter((id) => !said.has(id) && !quoted.has(id) && !within.includes(id)),
    [],
    "never said",
  );
});

test("what to do now stays one line beside what is said of the colours, so that the picture does not move", () => {
  const LETTERS = 130;
  for (const code of CODES) {
    speak(code);
    const lost = `${say("now-silent-since", { time: "14:02" })} ${say("now-comment-on")}`;
    const lines = [lost, say("now-look-write"), say("now-look-say"), say("now-ends-soon")];
    for (const line of lines) {
      const shown = line + say("estimated-colours");
      assert(shown.length <= LETTERS, `${code}, ${shown.length} letters: ${line}`);
    }
  }
  speak("en");
});

test("no script says a message that only the server has", () => {
  const only = [...scripts()].flatMap(([name, source]) => {
    /** @type {string[]} */
    const found = [];
    texts(source, (text) => {
      if (/^(error|refused)-[a-z-]+$/.test(text)) found.push(`${name}: ${text}`);
    });
    return found;
  });
  assert.deepEqual(only, [], "server/dashboard/src/http/assets.rs leaves it out");
});

test("a page speaks the language that it is told, and keeps its own if it does not know it", () => {
  assert.equal(say("pause"), "Pause");
  assert.equal(speak("it"), false);
  assert.equal(language(), "en");
  assert.equal(speak("de"), true);
  assert.equal(speak("de"), false);
  assert.equal(say("setting-of", { setting: 2, settings: 6 }), "Einstellung 2 von 6");
  assert.equal(say("show-all", { zoom: 2 }), "2,0× · Alles zeigen");
  assert.equal(say("comments-saved", { count: 1 }), "1 Kommentar gespeichert");
  assert.equal(sayAttribute("comment-box", "placeholder"), "Schreiben Sie, was Sie sehen");
  assert.equal(speak("en"), true);
  assert.equal(say("show-all", { zoom: 2 }), "2.0× · Show all");
});

test("words that are written from right to left do not turn the sentence around them", () => {
  assert.equal(words("sharp"), "sharp");
  assert.equal(words("حاد"), "\u2068حاد\u2069");
  assert.equal(say("undo-what", { what: words("حاد") }), "Undo: \u2068حاد\u2069");
});
