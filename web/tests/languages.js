// Lets the tests say messages: what the server's scripts `languages/*.js` do on a page, of the same files.

import { readdirSync, readFileSync } from "node:fs";

const FOLDER = new URL("../languages/", import.meta.url);

globalThis.parfocalLanguages = Object.fromEntries(
  readdirSync(FOLDER).map((name) => [name.replace(".ftl", ""), readFileSync(new URL(name, FOLDER), "utf8")]),
);
