// Hooks of node's module loader: `languages/de.js` is made of `web/languages/de.ftl`, as the server does it.

import { readFileSync } from "node:fs";

const MODULE = /\/static\/languages\/([a-z]+)\.js$/;

/** @type {import("node:module").ResolveHook} */
export async function resolve(specifier, context, next) {
  const url = specifier.startsWith(".") ? new URL(specifier, context.parentURL).href : specifier;
  return MODULE.test(url) ? { url, shortCircuit: true } : next(specifier, context);
}

/** @type {import("node:module").LoadHook} */
export async function load(url, context, next) {
  const code = MODULE.exec(url)?.[1];
  if (code === undefined) return next(url, context);
  const text = readFileSync(new URL(`../languages/${code}.ftl`, import.meta.url), "utf8");
  return { format: "module", shortCircuit: true, source: `export const text = ${JSON.stringify(text)};\n` };
}
