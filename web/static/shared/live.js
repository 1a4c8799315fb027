// The live connection: one WebSocket a page, for pictures and state. It reconnects by itself.
//
// Events, all CustomEvents; `detail` is:
//   "frame"       { header, bitmap, receivedAt }: a decoded picture, to be drawn before the handler returns
//   "session"     the session's view, or null
//   "status"      the devices' state
//   "connection"  { open }

const FIRST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 5000;
/** The server says something at least every 5 s; after this long without a word the connection is dead, whatever it looks like. */
const SILENCE_MS = 12000;
const LOOK_MS = 1000;

export class Live extends EventTarget {
  #role;
  #socket = null;
  #wait = FIRST_WAIT_MS;
  #heardAt = 0;
  #decoder = new TextDecoder();

  /** @param {"surgeon"|"operator"|"researcher"} role */
  constructor(role) {
    super();
    this.#role = role;
    document.addEventListener("visibilitychange", () => this.#tellVisibility());
    // A network that came back, or a page brought back from the browser's cache, need not wait for its turn.
    window.addEventListener("online", () => this.#connectAnew());
    window.addEventListener("pageshow", () => this.#connect());
    // Listeners are added after construction; they are to miss nothing.
    queueMicrotask(() => this.#connect());
    setInterval(() => this.#silent() && this.#connectAnew(), LOOK_MS);
  }

  #silent() {
    return this.#socket?.readyState <= WebSocket.OPEN && performance.now() - this.#heardAt > SILENCE_MS;
  }

  /** A link that broke without a word leaves a socket that looks open; closing it would wait for the other end. */
  #connectAnew() {
    const socket = this.#socket;
    if (socket && socket.readyState <= WebSocket.OPEN) {
      this.#socket = null;
      socket.close();
      this.#emit("connection", { open: false });
    }
    this.#connect();
  }

  #connect() {
    if (this.#socket && this.#socket.readyState <= WebSocket.OPEN) return;
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}/live?role=${this.#role}`);
    socket.binaryType = "arraybuffer";
    this.#heardAt = performance.now();
    socket.onopen = () => {
      if (socket !== this.#socket) return;
      this.#wait = FIRST_WAIT_MS;
      this.#tellVisibility();
      this.#emit("connection", { open: true });
    };
    socket.onmessage = ({ data }) => {
      if (socket !== this.#socket) return;
      this.#heardAt = performance.now();
      if (typeof data === "string") this.#hear(JSON.parse(data));
      else this.#show(socket, data);
    };
    socket.onclose = () => this.#lost(socket);
    this.#socket = socket;
  }

  #lost(socket) {
    if (socket !== this.#socket) return;
    this.#emit("connection", { open: false });
    // Some randomness, so that the pages of a restarted server do not all come at one moment.
    setTimeout(() => this.#connect(), this.#wait * (0.75 + Math.random() / 2));
    this.#wait = Math.min(this.#wait * 2, LONGEST_WAIT_MS);
  }

  #hear({ type, ...rest }) {
    this.#emit(type, type === "session" ? rest.view : rest);
  }

  /** A frame's message: length of the header (u16, little-endian), header (JSON), JPEG. */
  async #show(socket, data) {
    const receivedAt = performance.now();
    const length = new DataView(data).getUint16(0, true);
    const header = JSON.parse(this.#decoder.decode(new Uint8Array(data, 2, length)));
    try {
      const bitmap = await createImageBitmap(new Blob([new Uint8Array(data, 2 + length)], { type: "image/jpeg" }));
      this.#emit("frame", { header, bitmap, receivedAt });
      bitmap.close();
    } catch (error) {
      console.warn("a picture could not be decoded", error);
    }
    // Only now is the next one wanted; also after a picture that was no good, for the next may be.
    this.#send(socket, { type: "drawn", frame: header.frame });
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

/**
 * Returns what hands an answer's view of the session to `follow`, unless a view came over `live` while the answer was on its
 * way: that one is newer, or soon followed by one that is.
 */
export function unlessOvertaken(live, follow) {
  let heard = 0;
  live.addEventListener("session", () => heard++);
  return async (answer) => {
    const before = heard;
    const view = await answer;
    if (heard === before) follow(view);
  };
}
