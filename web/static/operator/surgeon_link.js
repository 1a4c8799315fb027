// The surgeon's link, to be copied.

import { byId, setText } from "../shared/dom.js";

const TOLD_MS = 2000;

export function offerLink() {
  const button = byId("copy-link");
  const link = byId("surgeon-link", HTMLInputElement);

  button.onclick = async () => {
    link.select();
    try {
      await navigator.clipboard.writeText(link.value);
    } catch {
      // The clipboard interface is missing on plain http.
      document.execCommand("copy");
    }
    setText(button, "Copied");
    setTimeout(() => setText(button, "Copy link"), TOLD_MS);
  };
}
