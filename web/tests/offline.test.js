import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import vm from "node:vm";

import { Contact } from "../static/shared/contact.js";
import { Awake } from "../static/surgeon/awake.js";
import { LastView } from "../static/surgeon/last_view.js";
import { storageAdvice } from "../static/surgeon/storage_words.js";
import { FakeTime, fakeStore, settle, VIEW } from "./around.js";

const HOUR_MS = 3_600_000;

test("the last view comes back as it was sent, without what is out of date", () => {
  const time = new FakeTime();
  const store = fakeStore();
  new LastView(store, "link", time.wall).keep(VIEW);
  const told = time.wall();

  time.wallMillis += HOUR_MS;
  const kept = new LastView(store, "link", time.wall).read();
  assert.deepEqual(kept?.view, { ...VIEW, remaining_seconds: null, prompt: null });
  assert.equal(kept?.heardAt, told);

  const heard = { heardAt: told + 5_000, certificateEnd: told + HOUR_MS };
  new LastView(store, "link", time.wall).touch(heard);
  const { heardAt, certificateEnd } = new LastView(store, "link", time.wall).read() ?? {};
  assert.deepEqual({ heardAt, certificateEnd }, heard);
});

test("a page loaded again without a network knows when the certificate ends", () => {
  const time = new FakeTime();
  const store = fakeStore();
  const lastView = new LastView(store, "link", time.wall);
  lastView.keep(VIEW);
  lastView.touch({ heardAt: time.wall(), certificateEnd: time.wall() + HOUR_MS });
  lastView.keep(VIEW);

  const loadedAgain = () => new Contact(time, new LastView(store, "link", time.wall).read());
  assert.equal(loadedAgain().isCertificateOver, false);
  time.wallMillis += HOUR_MS;
  assert.equal(loadedAgain().isCertificateOver, true);
});

test("the last view is gone under another link, after the session’s end, and after two hours", () => {
  const time = new FakeTime();
  /** @param {(last: LastView) => void} happens */
  const left = (happens, link = "link") => {
    const store = fakeStore();
    const last = new LastView(store, "link", time.wall);
    last.keep(VIEW);
    happens(last);
    return [new LastView(store, link, time.wall).read(), store.kept.size];
  };

  assert.deepEqual(
    left(() => {}, "other"),
    [null, 0],
  );
  assert.deepEqual(
    left((last) => last.keep({ ...VIEW, phase: "completed" })),
    [null, 0],
  );
  assert.deepEqual(
    left((last) => last.keep({ ...VIEW, phase: "aborted" })),
    [null, 0],
  );
  assert.deepEqual(
    left((last) => last.keep(null)),
    [null, 0],
  );
  assert.deepEqual(
    left(() => {
      time.wallMillis += 2 * HOUR_MS;
    }),
    [null, 0],
  );
});

test("a store that is full or holds something else gives no last view", () => {
  const time = new FakeTime();
  const full = fakeStore();
  full.full = true;
  const last = new LastView(full, "link", time.wall);
  last.keep(VIEW);
  assert.equal(last.read(), null);
  assert.match(storageAdvice(full), /do not close or reload the page/);

  const store = fakeStore();
  store.write("parfocal.last-view", "{not json");
  assert.equal(new LastView(store, "link", time.wall).read(), null);
  assert.equal(storageAdvice(fakeStore()), "");
});

/** A browser that gives screen locks, and ends them whenever the page is hidden. */
function screen() {
  const around = { visible: true, willing: true, given: 0, released: 0, changes: 0 };
  /** @type {(() => void)[]} */
  const onRelease = [];
  const awake = new Awake({
    request: async () => {
      if (!around.willing) throw new Error("the battery is low");
      around.given += 1;
      return {
        release: async () => {
          around.released += 1;
        },
        addEventListener: (_, run) => void onRelease.push(run),
      };
    },
    isVisible: () => around.visible,
    changed: () => {
      around.changes += 1;
    },
  });
  const hide = () => {
    around.visible = false;
    for (const run of onRelease.splice(0)) run();
  };
  return { around, awake, hide };
}

test("the screen stays on from a session’s first view to its end, also after the page was hidden", async () => {
  const { around, awake, hide } = screen();
  awake.follow(null);
  await settle();
  assert.equal(around.given, 0);

  awake.follow({ ...VIEW, phase: "ready" });
  await settle();
  awake.follow(VIEW);
  await settle();
  assert.equal(around.given, 1, "asked for once");

  hide();
  await awake.ask();
  assert.equal(around.given, 1, "a hidden page is refused, so it does not ask");
  around.visible = true;
  await awake.ask();
  assert.equal(around.given, 2);

  awake.follow({ ...VIEW, phase: "completed" });
  await settle();
  assert.equal(around.released, 1);
  assert.equal(awake.advice, "");
});

test("a browser that does not keep the screen on is reported, and asked again", async () => {
  const { around, awake } = screen();
  around.willing = false;
  awake.follow(VIEW);
  await settle();
  assert.match(awake.advice, /Set the tablet/);
  around.willing = true;
  await awake.ask();
  assert.equal(awake.advice, "");
  assert.equal(around.changes, 2);

  const cannot = new Awake({ request: null, isVisible: () => true, changed: () => {} });
  assert.match(cannot.advice, /Set the tablet/);
});

const SCRIPT = readFileSync(new URL("../static/offline/worker.js", import.meta.url), "utf8");
const ORIGIN = "https://theatre.local";

/** @param {string | Request} what */
const pathOf = (what) => new URL(typeof what === "string" ? what : what.url, ORIGIN).pathname;

/** The caches of one browser. Each worker finds in them what the worker before it kept. */
function fakeCaches() {
  /** @type {Map<string, Map<string, Response>>} */
  const all = new Map();
  return {
    all,
    keys: async () => [...all.keys()],
    delete: async (/** @type {string} */ name) => all.delete(name),
    open: async (/** @type {string} */ name) => {
      const kept = all.get(name) ?? new Map();
      all.set(name, kept);
      return {
        kept,
        match: async (/** @type {string | Request} */ what) => kept.get(pathOf(what))?.clone(),
        put: async (/** @type {string} */ what, /** @type {Response} */ answer) => {
          // A browser puts nothing into the cache before it has all of the body.
          await answer.clone().arrayBuffer();
          kept.set(pathOf(what), answer);
        },
        delete: async (/** @type {string} */ what) => kept.delete(pathOf(what)),
        addAll: async (/** @type {string[]} */ paths) => {
          const answers = await Promise.all(paths.map((path) => network.fetch(path)));
          paths.forEach((path, index) => {
            kept.set(path, answers[index]);
          });
        },
      };
    },
  };
}

/** The network's answer, which tests replace, and the workers' timers, which only tests let run. */
const network = {
  /** @type {(what: string | Request, options?: { signal?: AbortSignal }) => Promise<Response>} */
  fetch: () => Promise.reject(new TypeError("Failed to fetch")),
  /** @type {(() => void)[]} */
  timers: [],
};

const down = () => Promise.reject(new TypeError("Failed to fetch"));

/** A server with files and pages of `version`. @param {string} version */
const server = (version) => async (/** @type {string | Request} */ what) => {
  const path = pathOf(what);
  const headers = { "parfocal-page-version": version };
  if (path === "/surgeon") return new Response(`page of ${version}`, { headers });
  return new Response(`${path} from the network`);
};

/**
 * A worker of `version`, with the list of files that the server gives it.
 *
 * @param {string} version
 * @param {ReturnType<typeof fakeCaches>} caches
 */
function worker(version, caches) {
  /** @type {Record<string, (event: any) => void>} */
  const on = {};
  const self = {
    offline: { version, files: [`/static/${version}/surgeon/page.js`] },
    location: { origin: ORIGIN },
    skipWaiting: async () => {},
    addEventListener: (/** @type {string} */ name, /** @type {(event: any) => void} */ run) => {
      on[name] = run;
    },
  };
  const fetch = (/** @type {string | Request} */ what, /** @type {{ signal?: AbortSignal }} */ options) =>
    network.fetch(what, options);
  vm.runInNewContext(SCRIPT, {
    self,
    caches,
    fetch,
    URL,
    Response,
    AbortController,
    setTimeout: (/** @type {() => void} */ run) => network.timers.push(run),
    clearTimeout: () => {},
  });

  const lives = async (/** @type {string} */ name) => {
    /** @type {Promise<unknown>} */
    let done = Promise.resolve();
    on[name]?.({
      waitUntil: (/** @type {Promise<unknown>} */ promise) => {
        done = promise;
      },
    });
    await done;
  };

  /** The answer that a page gets; null if the worker leaves the request to the browser. */
  const get = async (/** @type {string} */ path, { mode = "navigate", method = "GET" } = {}) => {
    /** @type {Promise<Response> | null} */
    let answer = null;
    const request = { url: ORIGIN + path, mode, method };
    on.fetch?.({
      request,
      respondWith: (/** @type {Promise<Response>} */ promise) => {
        answer = promise;
      },
    });
    const response = /** @type {Response | null} */ (await answer);
    if (response === null) return null;
    return response.type === "error" ? "no page" : response.text();
  };

  return {
    get,
    start: async () => {
      await lives("install");
      await lives("activate");
    },
  };
}

test("the page and its files open without a network, and nothing else is kept", async () => {
  const caches = fakeCaches();
  const one = worker("one", caches);
  network.fetch = server("one");
  await one.start();

  network.fetch = down;
  assert.equal(await one.get("/surgeon"), "page of one");
  const file = "/static/one/surgeon/page.js";
  assert.equal(await one.get(file, { mode: "cors" }), `${file} from the network`);

  for (const path of ["/operator", "/researcher", "/api/surgeon/session", "/static/one/operator/page.js"]) {
    assert.equal(await one.get(path), null, path);
  }
  assert.equal(await one.get("/surgeon", { method: "POST" }), null);
  assert.deepEqual([...(caches.all.get("parfocal-surgeon-one")?.keys() ?? [])].sort(), [file, "/surgeon"]);
});

test("the server’s page comes first; a proxy’s error does not replace the one that is kept", async () => {
  const one = worker("one", fakeCaches());
  network.fetch = server("one");
  await one.start();

  network.fetch = async () => new Response("newer", { headers: { "parfocal-page-version": "one" } });
  assert.equal(await one.get("/surgeon"), "newer");
  network.fetch = async () => new Response("Bad gateway", { status: 502 });
  assert.equal(await one.get("/surgeon"), "newer");
  network.fetch = down;
  assert.equal(await one.get("/surgeon"), "newer");
});

test("a network that dies within the page opens the kept page, and leaves it kept", async () => {
  const one = worker("one", fakeCaches());
  network.fetch = server("one");
  await one.start();
  const headers = { "parfocal-page-version": "one" };

  network.fetch = async () => {
    const broken = new ReadableStream({
      pull: (body) => {
        body.enqueue(new TextEncoder().encode("page of"));
        body.error(new TypeError("network error"));
      },
    });
    return new Response(broken, { headers });
  };
  assert.equal(await one.get("/surgeon"), "page of one", "the connection is reset");

  network.fetch = async (_, { signal } = {}) => {
    const silent = new ReadableStream({
      start: (body) => signal?.addEventListener("abort", () => body.error(signal.reason)),
    });
    return new Response(silent, { headers });
  };
  network.timers = [];
  const opened = one.get("/surgeon");
  await settle();
  for (const run of network.timers) run();
  assert.equal(await opened, "page of one", "the rest does not come in time");

  network.fetch = down;
  assert.equal(await one.get("/surgeon"), "page of one", "it is still kept");
});

test("a tablet that is not let in any more opens nothing without a network", async () => {
  for (const refusal of [new Response("Forbidden", { status: 403 }), new Response("The session is over")]) {
    const one = worker("one", fakeCaches());
    network.fetch = server("one");
    await one.start();

    const words = await refusal.clone().text();
    network.fetch = async () => refusal;
    assert.equal(await one.get("/surgeon"), words);
    network.fetch = down;
    assert.equal(await one.get("/surgeon"), "no page");
  }
});

test("a newer server replaces everything at once, and a page never gets files of another version", async () => {
  const caches = fakeCaches();
  const one = worker("one", caches);
  network.fetch = server("one");
  await one.start();

  // The older worker sees the newer server's page first. It must not keep that page beside the older files.
  network.fetch = server("two");
  assert.equal(await one.get("/surgeon"), "page of two");
  network.fetch = down;
  assert.equal(await one.get("/surgeon"), "page of one");

  const two = worker("two", caches);
  network.fetch = server("two");
  await two.start();
  assert.deepEqual([...caches.all.keys()], ["parfocal-surgeon-two"]);
  network.fetch = down;
  assert.equal(await two.get("/surgeon"), "page of two");
});

test("a browser that could not fetch all files keeps the version that it has", async () => {
  const caches = fakeCaches();
  const one = worker("one", caches);
  network.fetch = server("one");
  await one.start();

  const two = worker("two", caches);
  network.fetch = async (what) => (pathOf(what).startsWith("/static/") ? down() : server("two")(what));
  await assert.rejects(two.start());
  network.fetch = down;
  assert.equal(await one.get("/surgeon"), "page of one");
});
