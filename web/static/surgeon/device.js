// Connects everything that this device keeps to the browser: to its storage, clocks, tabs and network.

import { keep, keepAudio, post } from "../shared/api.js";
import { storeOn } from "../shared/storage.js";
import { uuid } from "../shared/uuid.js";
import { diskStoreOn } from "./disk_store.js";
import { Drafts } from "./drafts.js";
import { Holding } from "./holding.js";
import { LastView } from "./last_view.js";
import { Origins } from "./origin.js";
import { Outbox } from "./outbox.js";
import { storageAdvice } from "./storage_words.js";
import { VoiceOutbox } from "./voice_outbox.js";

const TAB = "parfocal.tab";

export const store = storeOn(() => localStorage);
const tabStore = storeOn(() => sessionStorage);
export const clock = { page: () => performance.now(), wall: () => Date.now() };
const tab = tabStore.read(TAB) ?? uuid();

export const origins = new Origins(store, clock, uuid);
export const drafts = new Drafts(store, origins, uuid, tab);
export const lastView = new LastView(store, document.body.dataset.link ?? "", clock.wall);

/** What to do if this browser cannot store anything; empty if it can. */
export const storage = () => storageAdvice(store);

/**
 * Runs `run` after `ms` milliseconds. Returns a function that cancels it.
 *
 * @param {() => void} run
 * @param {number} ms
 */
export function later(run, ms) {
  const timer = setTimeout(run, ms);
  return () => clearTimeout(timer);
}

/** Opens the outbox for text. It follows this browser's network and other tabs. */
export function openOutbox() {
  /** @type {import("./disk_store.js").DiskStore<import("./outbox.js").Entry>} */
  const spare = diskStoreOn(() => indexedDB, "parfocal.outbox");
  const outbox = new Outbox({ store, spare, origins, send: keep, newId: uuid, wall: clock.wall, later });

  addEventListener("storage", ({ key, newValue }) => key && newValue === null && outbox.doneElsewhere(key));
  addEventListener("online", () => outbox.wake());
  document.addEventListener("visibilitychange", () => document.hidden || outbox.wake());
  addEventListener("beforeunload", (event) => {
    if (!outbox.durable && outbox.waiting.length > 0) event.preventDefault();
  });
  return outbox;
}

/** Opens the outbox for voice. It follows this browser's network. */
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

  addEventListener("online", () => outbox.wake());
  document.addEventListener("visibilitychange", () => document.hidden || outbox.wake());
  addEventListener("beforeunload", (event) => {
    if (!outbox.durable || outbox.isKeeping) event.preventDefault();
  });
  return outbox;
}

/**
 * Tells the server how much of a session this device holds.
 *
 * @param {Outbox} outbox
 * @param {VoiceOutbox} voice
 * @param {() => boolean} unsent whether the page's comment box holds a text
 */
export function openHolding(outbox, voice, unsent) {
  return new Holding({
    outbox,
    voice,
    drafts,
    unsent,
    later,
    post: (session, holding) => post("/api/surgeon/holding", { session, device: origins.device(), holding }),
  });
}

const RELOADED = "parfocal.reloaded-for-microphone";

/**
 * Loads the page again, but only once for each session. This is needed because a page that was loaded when no voice was
 * asked for may not use the microphone. Returns whether the page is being loaded again.
 *
 * @param {string} session
 */
export function reloadForMicrophone(session) {
  if (tabStore.read(RELOADED) === session || !tabStore.write(RELOADED, session)) return false;
  location.reload();
  return true;
}

/**
 * Calls `changed` with null when another tab has written a draft, and with the draft's slot when another tab has sent
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
 * Stores the tab's name while the page is hidden or being left, and removes it while the page is visible. So a tab that
 * is duplicated from a visible one gets a name of its own.
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
