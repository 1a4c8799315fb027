// The dialog to sign in: when it opens by itself, and what stays at the top of the page.

import assert from "node:assert/strict";
import { test } from "node:test";

/** An element, as far as the dialog's code uses them. */
class FakeElement {
  open = false;
  /** @type {unknown[]} */
  children = [];
  textContent = "";
  value = "";

  /** @param {...unknown} more */
  append(...more) {
    this.children.push(...more);
  }

  /** @param {...unknown} others */
  replaceChildren(...others) {
    this.children = others;
  }

  setAttribute() {}

  showModal() {
    this.open = true;
  }

  close() {
    this.open = false;
  }

  /** @param {string} id @returns {any} */
  find(id) {
    for (const child of this.children) {
      if (!(child instanceof FakeElement)) continue;
      if (Reflect.get(child, "id") === id) return child;
      const found = child.find(id);
      if (found) return found;
    }
    return null;
  }
}

const body = new FakeElement();
const person = new FakeElement();
body.append(person);
const page = {
  body,
  createElement: () => new FakeElement(),
  getElementById: (/** @type {string} */ id) => body.find(id),
  querySelector: () => person,
  dispatchEvent: () => true,
};
Object.assign(globalThis, {
  document: page,
  location: { pathname: "/operator" },
  HTMLAnchorElement: class {},
});

const { get, post } = await import("../static/shared/api.js");
await import("../static/shared/sign_in.js");
const { tellTrouble } = await import("../static/shared/trouble.js");

/** The server's answers, in order. @type {{ status: number, body: unknown }[]} */
const answers = [];
globalThis.fetch = async () => {
  const { status, body: answer } = answers.shift() ?? { status: 403, body: { error: "no", sign_in: true } };
  return new Response(JSON.stringify(answer), { status });
};

/** The page asks by itself. */
const look = () => get("/api/operator/session").catch(() => {});
/** Somebody does something. */
const act = () => post("/api/operator/focus", { focal_power: 0.5 }).catch(() => {});

const dialog = () => body.find("sign-in-dialog");

/** Sends the dialog's form, and waits for the answer. */
function send() {
  return dialog().children[0].onsubmit({ preventDefault() {} });
}

test("a dialog that was cancelled opens again only for what somebody does, until somebody has signed in", async () => {
  await look();
  assert.ok(dialog().open);
  dialog().close();

  await look();
  assert.ok(!dialog().open, "the page itself asks again and again");
  assert.ok(body.find("sign-in-need"), "the page goes on to say so");
  body.find("sign-in").onclick();
  assert.ok(dialog().open, "the button at the top");
  dialog().close();
  await act();
  assert.ok(dialog().open);

  answers.push({ status: 200, body: { display: "Nurse Op", role: "operator", home: "/operator" } });
  await send();
  assert.ok(!dialog().open);
  assert.equal(body.find("sign-in-need"), null);

  await look();
  assert.ok(dialog().open, "a sign-in that ends later is asked for again");
});

test("what was refused because nobody was signed in is no longer said once somebody is", async () => {
  const refused = new FakeElement();
  const wrong = new FakeElement();
  const told = (/** @type {any} */ element) => (/** @type {unknown} */ error) => tellTrouble(element, error);
  await post("/api/operator/focus", { focal_power: 0.5 }).catch(told(refused));
  answers.push({ status: 409, body: { error: "a session is under way" } });
  await post("/api/operator/focus", { focal_power: 0.5 }).catch(told(wrong));
  assert.deepEqual([refused.textContent, wrong.textContent], ["no", "a session is under way"]);

  answers.push({ status: 200, body: { display: "Dr Ada", role: "operator" } });
  await send();
  assert.deepEqual([refused.textContent, wrong.textContent], ["", "a session is under way"]);
});
