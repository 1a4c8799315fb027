import assert from "node:assert/strict";
import { test } from "node:test";

import { judge, kindOf, WORDS } from "../static/trust/verdict.js";

/**
 * A browser that gets answers only from addresses that begin with one of `answering`.
 *
 * @param {...string} answering
 */
const browser =
  (...answering) =>
  /** @param {string} address */
  async (address) => {
    if (!answering.some((start) => address.startsWith(start))) throw new TypeError("Failed to fetch");
  };

test("a device that gets an encrypted answer trusts the server", async () => {
  assert.equal(await judge(browser("https://10.0.0.5:8080/", "/"), "10.0.0.5:8080"), "trusted");
});

test("a server that answers only unencrypted is not trusted, and one that answers nowhere is not there", async () => {
  assert.equal(await judge(browser("/"), "10.0.0.5:8080"), "not-trusted");
  assert.equal(await judge(browser(), "10.0.0.5:8080"), "unreachable");
});

test("each verdict has words of its own", () => {
  const findings = Object.values(WORDS).map((words) => words.finding);
  assert.equal(new Set(findings).size, 3);
});

test("the steps of the present device are open first", () => {
  const mac =
    "Mozilla/5.0 (Macintosh; Intel Mac OS X 10_15_7) AppleWebKit/605.1.15 Version/17.4 Safari/605.1.15";
  assert.equal(kindOf(mac, 5), "apple", "an iPad");
  assert.equal(kindOf(mac, 0), "mac");
  assert.equal(
    kindOf("Mozilla/5.0 (Linux; Android 14; SM-X710) AppleWebKit/537.36 Chrome/126.0", 5),
    "android",
  );
  assert.equal(
    kindOf("Mozilla/5.0 (Windows NT 10.0; Win64; x64) AppleWebKit/537.36 Chrome/126.0", 0),
    "windows",
  );
  assert.equal(kindOf("Mozilla/5.0 (X11; Linux x86_64) AppleWebKit/537.36 Chrome/126.0", 0), "linux");
});
