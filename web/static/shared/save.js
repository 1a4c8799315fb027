// Saves what the page has made as a file.

/**
 * @param {Blob} blob
 * @param {string} name the file's name
 */
export function saveAs(blob, name) {
  const address = URL.createObjectURL(blob);
  const link = Object.assign(document.createElement("a"), { href: address, download: name });
  link.click();
  // The browser reads the file after this returns.
  setTimeout(() => URL.revokeObjectURL(address), 60_000);
}
