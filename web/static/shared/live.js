// The live connection: one WebSocket per page, for pictures and state. It reconnects by itself.

import { Pictures } from "./pacing.js";
import { Reconnection } from "./reconnection.js";

const LOOK_MS = 1000;

/**
 * A connection that the page opened before its scripts came, with what was heard on it, until it is taken over.
 *
 * @typedef {object} Early
 * @property {WebSocket} socket
 * @property {{ data: any, at: number }[]} heard `at` is in milliseconds of the page's clock
 */

/** Takes over the connection that the page opened early; null if there is none that is alive. */
function takeEarly() {
  const page = /** @type {{ early?: Early }} */ (globalThis);
  const early = page.early;
  delete page.early;
  return early && isAlive(early.socket) ? early : null;
}

/** The server closes the connection with this code when the page's link is no longer valid. */
const LINK_OVER = 4403;

/** Delay before the picture's size on the screen is sent to the server. During a pinch the size keeps changing. */
const SCREEN_MS = 150;

/** @typedef {{ type: string, [what: string]: unknown }} Message a message to the server */

/**
 * A page's callbacks. `frame` must draw its picture before it returns.
 *
 * @typedef {object} Listener
 * @property {(frame: Stream.Frame) => void} [frame]
 * @property {(view: any) => void} [session] the session's view, or null
 * @property {(status: any) => void} [status] the devices' state
 * @property {() => void} [heard] the server sent something, whatever it was
 * @property {(open: boolean) => void} [connection]
 * @property {() => void} [over] the page's link is no longer valid; no connection is tried again
 */

export class Live {
  #role;
  /** @type {Listener[]} */
  #listeners = [];
  /** @type {WebSocket | null} */
  #socket = null;
  #reconnection = new Reconnection();
  /** Screen pixels that the picture covers from left to right. @type {number | null} */
  #screen = null;
  /** The last message of each type about this page, which each new connection gets. @type {Map<string, Message>} */
  #told = new Map();
  /** Whether the page's link is no longer valid. */
  #over = false;
  /** Whether a timer runs that will send `#screen` to the server. */
  #screenWaits = false;
  /** Runs until the next attempt to connect. @type {ReturnType<typeof setTimeout> | undefined} */
  #retry;

  /** @param {"surgeon" | "operator" | "researcher"} role */
  constructor(role) {
    this.#role = role;
    this.#tellVisibility();
    document.addEventListener("visibilitychange", () => this.#tellVisibility());

    // When the network or a page from the browser's cache comes back, there is no need to wait for the next attempt.
    window.addEventListener("online", () => this.#connectAnew());
    window.addEventListener("pageshow", () => this.#connect());

    // Connects only later, because listeners are added after construction and must miss nothing.
    queueMicrotask(() => this.#connect());
    setInterval(() => this.#isSilent() && this.#connectAnew(), LOOK_MS);
  }

  /** @param {Listener} listener */
  listen(listener) {
    this.#listeners.push(listener);
  }

  /**
   * Tells the server that the whole picture covers `width` pixels of the screen from left to right. The server chooses
   * the size of its pictures to suit.
   *
   * @param {number} width
   */
  tellScreen(width) {
    if (width === this.#screen) return;
    this.#screen = width;
    if (this.#screenWaits) return;
    this.#screenWaits = true;
    setTimeout(() => {
      this.#screenWaits = false;
      this.tell({ type: "screen", width: this.#screen });
    }, SCREEN_MS);
  }

  /**
   * Tells the server something about this page, now and on each new connection.
   *
   * @param {Message} message
   */
  tell(message) {
    this.#told.set(message.type, message);
    send(this.#socket, message);
  }

  #isSilent() {
    return isAlive(this.#socket) && this.#reconnection.isSilent(performance.now());
  }

  /**
   * Opens a new connection without waiting for the old one to close. A link that broke silently leaves a socket that
   * looks open, and closing it would wait for the other end.
   */
  #connectAnew() {
    const socket = this.#socket;
    if (socket && isAlive(socket)) {
      this.#socket = null;
      socket.close();
      this.#tellConnection(false);
    }
    this.#connect();
  }

  #connect() {
    if (this.#over || isAlive(this.#socket)) return;
    // This is the attempt. Another timer beside that of its own end would double the attempts.
    clearTimeout(this.#retry);
    const early = takeEarly();
    const socket = early?.socket ?? new WebSocket(this.#address());
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    this.#reconnection.heard(performance.now());
    const pictures = this.#pictures(socket);

    const opened = () => {
      if (socket !== this.#socket) return;
      this.#reconnection.opened();
      for (const message of this.#told.values()) send(socket, message);
      this.#tellConnection(true);
    };
    const take = (/** @type {any} */ data, /** @type {number} */ at) => {
      if (socket !== this.#socket) return;
      this.#reconnection.heard(at);
      for (const listener of this.#listeners) listener.heard?.();
      if (typeof data === "string") this.#hear(JSON.parse(data));
      else pictures.take(data, at);
    };
    socket.onopen = opened;
    socket.onmessage = ({ data }) => take(data, performance.now());
    socket.onclose = ({ code }) => this.#lost(socket, code);

    if (socket.readyState === WebSocket.OPEN) opened();
    for (const { data, at } of early?.heard ?? []) take(data, at);
  }

  #address() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    return `${scheme}//${location.host}/live?role=${this.#role}`;
  }

  /**
   * @param {WebSocket} socket
   * @param {number} code
   */
  #lost(socket, code) {
    if (socket !== this.#socket) return;
    this.#tellConnection(false);
    if (code === LINK_OVER) {
      this.#over = true;
      for (const listener of this.#listeners) listener.over?.();
      return;
    }
    this.#retry = setTimeout(() => this.#connect(), this.#reconnection.nextWait(Math.random()));
  }

  /** @param {{ type: string, view?: unknown }} message */
  #hear({ type, ...rest }) {
    for (const listener of this.#listeners) {
      if (type === "session") listener.session?.(rest.view);
      if (type === "status") listener.status?.(rest);
    }
  }

  /** @param {WebSocket} socket */
  #pictures(socket) {
    return new Pictures({
      decode: (jpeg) => createImageBitmap(new Blob([jpeg], { type: "image/jpeg" })),
      draw: (header, bitmap, receivedAt) => {
        for (const listener of this.#listeners) listener.frame?.({ header, bitmap, receivedAt });
        bitmap.close();
      },
      acknowledge: (frame, held, shown) => send(socket, { type: "drawn", frame, held, shown }),
      complain: (error) => console.warn("a picture could not be shown", error),
      now: () => performance.now(),
    });
  }

  #tellVisibility() {
    this.tell({ type: "visible", visible: !document.hidden });
  }

  /** @param {boolean} open */
  #tellConnection(open) {
    for (const listener of this.#listeners) listener.connection?.(open);
  }
}

/** @param {WebSocket | null} socket */
function isAlive(socket) {
  return socket !== null && socket.readyState <= WebSocket.OPEN;
}

/**
 * @param {WebSocket | null} socket
 * @param {Message} message
 */
function send(socket, message) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

/**
 * Returns a function that waits for an answer and passes its view of the session to `follow`. If a view came over
 * `live` meanwhile, the answer is dropped: the other view is newer, or a newer one follows soon.
 *
 * @template View
 * @param {Live} live
 * @param {(view: View) => void} follow
 * @returns {(answer: Promise<View>) => Promise<void>}
 */
export function unlessOvertaken(live, follow) {
  let heard = 0;
  live.listen({
    session: () => {
      heard += 1;
    },
  });

  return async (answer) => {
    const before = heard;
    const view = await answer;
    if (heard === before) follow(view);
  };
}
