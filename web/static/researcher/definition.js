// A study's definition on its way from a file to the server. Its hash must be that of the file, so that all sites have the
// same. `File.text()` drops a byte order mark, and a text area turns every line end into a line feed.

/**
 * The text of a file, byte for byte: with its byte order mark and its line ends.
 * @param {ArrayBuffer | Uint8Array} bytes
 * @returns {string}
 * @throws {TypeError} If it is not UTF-8.
 */
export function exactText(bytes) {
  return new TextDecoder("utf-8", { fatal: true, ignoreBOM: true }).decode(bytes);
}

/** The definition that was chosen, and how the page shows it. */
export class Definition {
  #exact = "";
  #shown = "";

  /**
   * Takes the text of a file, and what a text area made of it.
   * @param {string} exact
   * @param {string} shown
   */
  take(exact, shown) {
    this.#exact = exact;
    this.#shown = shown;
  }

  /**
   * What to send: the file's text as it came, unless it was changed on the page.
   * @param {string} shown What stands in the text area now.
   */
  toSend(shown) {
    return shown === this.#shown ? this.#exact : shown;
  }
}
