// What a browser keeps over a reload. A device may be full, or its owner may have switched storage
// off: then reading finds nothing and writing returns false, and the page remembers for itself.

/**
 * @typedef {object} Store
 * @property {(name: string) => string | null} read
 * @property {(name: string, text: string) => boolean} write whether it is kept
 * @property {(name: string) => void} remove
 * @property {(prefix: string) => string[]} names
 */

/**
 * A store on `open()`, which is `localStorage` or `sessionStorage` in a browser.
 *
 * @param {() => Storage} open may throw where storage is switched off
 * @returns {Store}
 */
export function storeOn(open) {
  return {
    read(name) {
      try {
        return open().getItem(name);
      } catch {
        return null;
      }
    },

    write(name, text) {
      try {
        open().setItem(name, text);
        return true;
      } catch {
        return false;
      }
    },

    remove(name) {
      try {
        open().removeItem(name);
      } catch {
        // Switched off: there was nothing to remove.
      }
    },

    names(prefix) {
      try {
        return Object.keys(open()).filter((name) => name.startsWith(prefix));
      } catch {
        return [];
      }
    },
  };
}
