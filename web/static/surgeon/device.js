// What this device keeps, joined to the browser: its storage, its clocks, its tabs, its network.

import { keep, keepAudio } from "../shared/api.js";
import { storeOn } from "../shared/storage.js";
import { uuid } from "../shared/uuid.js";
import { diskStoreOn } from "./disk_store.js";
import { Drafts } from "./drafts.js";
import { LastView } from "./last_view.js";
import { Origins } from "./origin.js";
import { Outbox } from "./outbox.js";
import { storageAdvice } from "./storage_words.js";
import { VoiceOutbox } from "./voice_outbox.js";

const TAB = "parfocal.tab";

const store = storeOn(() => localStorage);
const tabStore = storeOn(() => sessionStorage);
export const clock = { page: () => performance.now(), wall: () => Date.now() };
const tab = tabStore.read(TAB) ?? uuid();

export const origins = new Origins(store, clock, uuid);
export const drafts = new Drafts(store, origins, uuid, tab);
export const lastView = new LastView(store, document.body.dataset.link ?? "", clock.wall);

/** What to do where this browser keeps nothing; empty where it keeps things. */
export const storage = storageAdvice(store);

/**
 * Runs `run` after `ms`; returns what cancels that.
 *
 * @param {() => void} run
 * @param {number} ms
 */
export function later(run, ms) {
  const timer = setTimeout(run, ms);
  return () => clearTimeout(timer);
}

/** An outbox that follows this browser's network and its other tabs. */
export function openOutbox() {
  /** @type {import("./disk_store.js").DiskStore<import("./outbox.js").Entry>} */
  const spare = diskStoreOn(() => indexedDB, "parfocal.outbox");
  const outbox = new Outbox({ store, spare, origins, send: keep, newId: uuid, wall: clock.wall, later });

  addEventListener("storage", ({ key, newValue }) => key && newValue === null && outbox.doneElsewhere(key));
  addEventListener("online", () => outbox.nudge());
  document.addEventListener("visibilitychange", () => document.hidden || outbox.nudge());
  addEventListener("beforeunload", (event) => {
    if (!outbox.durable && outbox.waiting.length > 0) event.preventDefault();
  });
  return outbox;
}

/** An outbox for what is said aloud, which follows this browser's network. */
export function openVoiceOutbox() {
  const outbox = new VoiceOutbox({
    store: diskStoreOn(() => indexedDB, "parfocal.voice"),
    origins,
    send: keep,
    sendAudio: keepAudio,
    newId: uuid,
    wall: clock.wall,
    later,
  });

  addEventListener("online", () => outbox.nudge());
  document.addEventListener("visibilitychange", () => document.hidden || outbox.nudge());
  addEventListener("beforeunload", (event) => {
    if (!outbox.durable) event.preventDefault();
  });
  return outbox;
}

const RELOADED = "parfocal.reloaded-for-microphone";

/**
 * Loads the page again, once for each session: a page that was loaded when no voice was asked for
 * may not use the microphone. Whether it is being loaded again.
 *
 * @param {string} session
 */
export function reloadForMicrophone(session) {
  if (tabStore.read(RELOADED) === session || !tabStore.write(RELOADED, session)) return false;
  location.reload();
  return true;
}

/**
 * Calls `changed` when another tab has written a draft, and with the draft's slot when it has sent
 * it or taken it over.
 *
 * @param {(slot: string | null) => void} changed
 */
export function followDrafts(changed) {
  addEventListener("storage", ({ key, newValue }) => {
    if (key !== null && drafts.isSlot(key)) changed(newValue === null ? key : null);
  });
}

/**
 * While the page is in sight its tab's name is stored nowhere, so that a tab duplicated from it
 * gets a name of its own.
 *
 * @param {boolean} leaving
 */
function noteTab(leaving) {
  if (leaving) tabStore.write(TAB, tab);
  else tabStore.remove(TAB);
}

origins.sight(document.hidden);
noteTab(document.hidden);
document.addEventListener("visibilitychange", () => {
  origins.sight(document.hidden);
  noteTab(document.hidden);
});
addEventListener("pagehide", () => noteTab(true));
addEventListener("pageshow", () => noteTab(document.hidden));
