// Copies the libraries that the pages use from node_modules to static/, where the server takes them from: building the
// server needs no npm. With `--check` nothing is written, and a copy that differs is a failure.

import { readFileSync, writeFileSync } from "node:fs";

const FILES = [
  "builtins.js",
  "bundle.js",
  "memoizer.js",
  "resolver.js",
  "resource.js",
  "scope.js",
  "types.js",
];
const PACKAGE = new URL("./node_modules/@fluent/bundle/", import.meta.url);
const { version } = JSON.parse(readFileSync(new URL("package.json", PACKAGE), "utf8"));

// The files are as Mozilla built them, so that nobody has to compare them by eye.
const HEADER = `// @ts-nocheck
// From @fluent/bundle ${version}, Mozilla Foundation and contributors, Apache License 2.0 (LICENSE-APACHE).
`;

let differ = false;
for (const name of FILES) {
  const copy = new URL(`./static/fluent/${name}`, import.meta.url);
  const wanted = HEADER + readFileSync(new URL(`esm/${name}`, PACKAGE), "utf8");
  if (!process.argv.includes("--check")) {
    writeFileSync(copy, wanted);
  } else if (readFileSync(copy, "utf8") !== wanted) {
    console.warn(`static/fluent/${name} is not that of @fluent/bundle ${version}: npm run vendor`);
    differ = true;
  }
}
process.exitCode = differ ? 1 : 0;
