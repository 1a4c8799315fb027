// Lets the tests import the modules that the server makes of the languages' files.

import { register } from "node:module";

register("./language_modules.js", import.meta.url);
