// Where and when something is said: on which device, as which of all that is said there, and how long ago. An entry may
// wait for the network; its wait is measured by the page's monotonic clock, which nobody can set.

import { uuid } from "../shared/dom.js";

const DEVICE = "parfocal.device";
const SEQUENCE = "parfocal.sequence";
/** This load of the page: only two readings of one page's clock can be compared. */
const PAGE = uuid();
/** The clocks of a page that was hidden may differ by this much; by more, the device slept, or a clock was set. */
const DRIFT_MS = 1000;

/** What stands where this device stores nothing: then each load of the page counts as a device. */
let ownDevice = uuid();
let latest = 0;

/** For how long this page's clock stood still while the device slept, as far as the wall clock tells. */
let slept = 0;
let hidden = document.hidden ? readClocks() : null;

function readClocks() {
  return { page: performance.now(), wall: Date.now() };
}

document.addEventListener("visibilitychange", () => {
  const now = readClocks();
  if (!document.hidden && hidden) {
    const gap = now.wall - hidden.wall - (now.page - hidden.page);
    if (gap > DRIFT_MS) slept += gap;
  }
  hidden = document.hidden ? now : null;
});

/** This device: the same in all tabs of its browser. */
export function device() {
  const known = read(DEVICE);
  if (known) return known;
  write(DEVICE, ownDevice);
  // Another tab may have been first.
  ownDevice = read(DEVICE) ?? ownDevice;
  return ownDevice;
}

function next() {
  latest = Math.max(latest, Number(read(SEQUENCE)) || 0) + 1;
  write(SEQUENCE, String(latest));
  return latest;
}

/** To be kept with what is said now. */
export function stamp() {
  return { device: device(), sequence: next(), client_millis: Date.now(), clock: { page: PAGE, at: performance.now(), slept } };
}

/** What the server is told of `stamp`, at the moment of sending. */
export function origin({ clock, ...told }) {
  const samePage = clock?.page === PAGE;
  const waited = samePage ? performance.now() - clock.at + slept - clock.slept : Date.now() - told.client_millis;
  const awake = samePage && slept === clock.slept;
  return { ...told, waited_millis: Math.max(0, Math.round(waited)), waited_by: awake ? "page-clock" : "wall-clock" };
}

function read(name) {
  try {
    return localStorage.getItem(name);
  } catch {
    return null;
  }
}

function write(name, value) {
  try {
    localStorage.setItem(name, value);
  } catch {
    // full or switched off: this page remembers
  }
}
