// Tries each thing that a trial needs of a tablet. Nothing that is tried stays on the tablet.

/** @typedef {import("./words.js").Part} Part */

const PATIENCE_MS = 8000;
const NAME = "parfocal.tablet-trial";

/** A JPEG of one pixel. */
const PIXEL =
  "/9j/4AAQSkZJRgABAQEASABIAAD/2wBDAAEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEB" +
  "AQEBAQH/wAALCAABAAEBAREA/8QAFAABAAAAAAAAAAAAAAAAAAAAA//EABQQAQAAAAAAAAAAAAAAAAAAAAD/2gAIAQEAAD8AN//Z";

/**
 * Tries everything, the microphone first, because it must be asked for in a tap.
 *
 * @param {import("../shared/storage.js").Store} store
 * @returns {Promise<import("./words.js").Tried[]>}
 */
export async function tryAll(store) {
  /** @type {[Part, Promise<boolean>][]} */
  const trials = [
    ["microphone", tryMicrophone()],
    ["encrypted", Promise.resolve(globalThis.isSecureContext)],
    ["storage", Promise.resolve(tryStorage(store))],
    ["disk", tryDisk()],
    ["stream", tryStream()],
    ["picture", tryPicture()],
    ["screen-on", tryScreenLock()],
  ];
  return Promise.all(trials.map(async ([part, trial]) => ({ part, works: await inTime(trial) })));
}

/**
 * What `trial` found; false if it failed or takes too long. A browser may ask the person first.
 *
 * @param {Promise<boolean>} trial
 */
function inTime(trial) {
  const late = new Promise((resolve) => setTimeout(() => resolve(false), 4 * PATIENCE_MS));
  return Promise.race([trial.catch(() => false), late]).then(Boolean);
}

/** @param {import("../shared/storage.js").Store} store */
function tryStorage(store) {
  const keeps = store.write(NAME, "1") && store.read(NAME) === "1";
  store.remove(NAME);
  return keeps;
}

/** @returns {Promise<boolean>} */
function tryDisk() {
  return new Promise((resolve) => {
    const opening = indexedDB.open(NAME, 1);
    opening.onerror = () => resolve(false);
    opening.onupgradeneeded = () => opening.result.createObjectStore("kept", { keyPath: "id" });
    opening.onsuccess = () => {
      const database = opening.result;
      const transaction = database.transaction("kept", "readwrite");
      transaction.objectStore("kept").put({ id: "sound", audio: new ArrayBuffer(8) });
      const end = (/** @type {boolean} */ works) => {
        database.close();
        indexedDB.deleteDatabase(NAME);
        resolve(works);
      };
      transaction.oncomplete = () => end(true);
      transaction.onerror = () => end(false);
      transaction.onabort = () => end(false);
    };
  });
}

/** @returns {Promise<boolean>} */
function tryStream() {
  return new Promise((resolve) => {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}/live?role=surgeon`);
    const timer = setTimeout(() => end(false), PATIENCE_MS);
    const end = (/** @type {boolean} */ works) => {
      clearTimeout(timer);
      socket.close();
      resolve(works);
    };
    socket.onmessage = () => end(true);
    socket.onerror = () => end(false);
  });
}

async function tryPicture() {
  const bytes = Uint8Array.from(atob(PIXEL), (letter) => letter.charCodeAt(0));
  const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/jpeg" }));
  const context = document.createElement("canvas").getContext("2d");
  context?.drawImage(bitmap, 0, 0);
  return context !== null && bitmap.width === 1;
}

async function tryMicrophone() {
  const meter = new AudioContext();
  const resumed = meter.resume();
  /** @type {MediaStreamTrack[]} */
  let tracks = [];
  try {
    const stream = await navigator.mediaDevices.getUserMedia({ audio: true });
    tracks = stream.getTracks();
    await resumed;
    const recorder = new MediaRecorder(stream);
    recorder.start();
    recorder.stop();
    return true;
  } finally {
    // Also where only the recorder fails: otherwise the tablet would show that something listens.
    for (const track of tracks) track.stop();
    meter.close();
  }
}

async function tryScreenLock() {
  const lock = await navigator.wakeLock.request("screen");
  await lock.release();
  return true;
}
