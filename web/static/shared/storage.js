// Storage that survives a reload of the page. A device may be full, or its owner may have switched storage off. Then
// reading finds nothing and writing returns false, and the page keeps the text in memory.

/**
 * @typedef {object} Store
 * @property {(name: string) => string | null} read
 * @property {(name: string, text: string) => boolean} write returns whether the text is stored
 * @property {(name: string) => void} remove
 * @property {(prefix: string) => string[]} names all stored names that begin with `prefix`
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
