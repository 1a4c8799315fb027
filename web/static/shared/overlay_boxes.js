/**
 * Calls `apply(name, on)` for each of the page's overlay checkboxes, now and whenever one changes.
 *
 * @param {(name: string, on: boolean) => void} apply
 */
export function followOverlayBoxes(apply) {
  for (const box of document.querySelectorAll("input")) {
    const { overlay } = box.dataset;
    if (overlay === undefined) continue;
    box.addEventListener("change", () => apply(overlay, box.checked));
    apply(overlay, box.checked);
  }
}
