// The live connection: one WebSocket a page, for pictures and state. Reconnects by itself.
//
// Events (all CustomEvents):
//   "frame"       { header, bitmap, receivedAt }   a decoded picture; whoever listens draws it at once
//   "session"     view or null
//   "status"      the devices' state
//   "connection"  { open }

const FIRST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 5000;

export class Live extends EventTarget {
  #socket = null;
  #wait = FIRST_WAIT_MS;
  #decoder = new TextDecoder();
  #role;

  constructor(role) {
    super();
    this.#role = role;
    document.addEventListener("visibilitychange", () => this.#tellVisibility());
    window.addEventListener("online", () => this.#connect());
    this.#connect();
  }

  #connect() {
    if (this.#socket && this.#socket.readyState <= WebSocket.OPEN) return;
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}/live?role=${this.#role}`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.#wait = FIRST_WAIT_MS;
      this.#tellVisibility();
      this.#emit("connection", { open: true });
    };
    socket.onmessage = ({ data }) => (typeof data === "string" ? this.#hear(JSON.parse(data)) : this.#show(socket, data));
    socket.onclose = () => {
      this.#emit("connection", { open: false });
      // Some randomness, so that all the pages of a restarted server do not come at the same moment.
      setTimeout(() => this.#connect(), this.#wait * (0.75 + Math.random() / 2));
      this.#wait = Math.min(this.#wait * 2, LONGEST_WAIT_MS);
    };
    this.#socket = socket;
  }

  #hear(message) {
    const { type, ...rest } = message;
    this.#emit(type, type === "session" ? rest.view : rest);
  }

  async #show(socket, data) {
    const receivedAt = performance.now();
    const length = new DataView(data).getUint16(0, true);
    const header = JSON.parse(this.#decoder.decode(new Uint8Array(data, 2, length)));
    try {
      const bitmap = await createImageBitmap(new Blob([new Uint8Array(data, 2 + length)], { type: "image/jpeg" }));
      this.#emit("frame", { header, bitmap, receivedAt });
      bitmap.close();
    } finally {
      // Also after a picture that cannot be decoded: the next one may be.
      this.#send(socket, { type: "drawn", frame: header.frame });
    }
  }

  #tellVisibility() {
    if (this.#socket) this.#send(this.#socket, { type: "visible", visible: !document.hidden });
  }

  #send(socket, message) {
    if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  }

  #emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
