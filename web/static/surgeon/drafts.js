// What is being written, kept on this device. A draft belongs to the tab that it is written in: another tab may take it over
// when asked to, and sends it as it stands once its place is gone. It carries the key under which it will be sent, so that
// it is kept once even if two tabs send it.

import { uuid } from "../shared/dom.js";
import { stamp } from "./origin.js";

const PREFIX = "parfocal.draft.";
const TAB = "parfocal.tab";

/** This tab, also after a reload. */
const tab = tabName() ?? uuid();

function tabName() {
  try {
    return sessionStorage.getItem(TAB);
  } catch {
    return null;
  }
}

/** While the page is in sight its name is stored nowhere, so that a tab duplicated from it gets a name of its own. */
function noteTab(leaving) {
  try {
    if (leaving) sessionStorage.setItem(TAB, tab);
    else sessionStorage.removeItem(TAB);
  } catch {
    // switched off: after a reload this tab is another
  }
}

noteTab(document.hidden);
document.addEventListener("visibilitychange", () => noteTab(document.hidden));
addEventListener("pagehide", () => noteTab(true));
addEventListener("pageshow", () => noteTab(document.hidden));

/** Calls `changed` when another tab has written a draft, or with its slot when it has sent it or taken it over. */
export function followDrafts(changed) {
  addEventListener("storage", ({ key, newValue }) => key?.startsWith(PREFIX) && changed(newValue === null ? key : null));
}

/** The drafts on this device whose names begin with `start`, in whatever tab: `{ rest, owner, slot, key, given, value }`. */
export function draftsOf(start) {
  try {
    return Object.keys(localStorage)
      .filter((slot) => slot.startsWith(PREFIX + start))
      .flatMap((slot) => {
        const [name, owner = ""] = slot.slice(PREFIX.length).split("#");
        const kept = parsed(slot);
        return kept ? [{ rest: name.slice(start.length), owner, slot, ...kept }] : [];
      });
  } catch {
    return [];
  }
}

/** What stands in `slot`. An older page kept the value alone. */
function parsed(slot) {
  try {
    const kept = JSON.parse(localStorage.getItem(slot));
    if (kept === null) return null;
    return kept.given ? kept : { key: uuid(), given: stamp(), value: kept };
  } catch {
    return null;
  }
}

/** Takes a draft of any tab off this device: it is sent, or taken over. */
export function forgetDraft({ slot }) {
  try {
    localStorage.removeItem(slot);
  } catch {
    // switched off: there was nothing to remove
  }
}

/** A draft of this tab. */
export class Draft {
  #name;
  #slot;
  /** `{ key, given, value }`, or null while nothing is being written. */
  #kept;
  #stored;

  constructor(name) {
    this.#name = name;
    this.#slot = `${PREFIX}${name}#${tab}`;
    this.#kept = draftsOf(name).find(({ rest, owner }) => rest === "" && owner === tab) ?? null;
    this.#stored = this.#kept !== null;
  }

  /** What was being written, or null. */
  read() {
    return this.#kept?.value ?? null;
  }

  /** Keeps `value`; null forgets it. */
  write(value) {
    if (value === null) {
      this.take();
      return;
    }
    const { key } = this.#kept ?? { key: uuid() };
    this.#kept = { key, given: stamp(), value };
    try {
      localStorage.setItem(this.#slot, JSON.stringify(this.#kept));
      this.#stored = true;
    } catch {
      // full or switched off: the text is still in its box
      this.#stored = false;
    }
  }

  /** Gives `{ key, given }`, under which what was written is to be sent, and forgets it; nothing where nothing was written. */
  take() {
    const { key, given } = this.#kept ?? {};
    this.#kept = null;
    forgetDraft({ slot: this.#slot });
    this.#stored = false;
    return { key, given };
  }

  /** Whether this draft stands in `slot`. */
  isIn(slot) {
    return this.#stored && slot === this.#slot;
  }

  /** Whether another tab has taken this draft over. */
  get claimed() {
    return this.#kept !== null && this.elsewhere().some(({ key }) => key === this.#kept.key);
  }

  /** The drafts of the same thing in other tabs. */
  elsewhere() {
    return draftsOf(this.#name).filter(({ rest, owner }) => rest === "" && owner !== tab);
  }

  /** Takes over `other`, one of those elsewhere. */
  claim(other) {
    this.#kept = { key: other.key, given: other.given, value: other.value };
    this.write(other.value);
    forgetDraft(other);
  }
}
