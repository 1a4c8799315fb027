// The form of a ranking: each setting can be dragged, moved by arrows, or put on top by one tap.

import { make, setText } from "../shared/dom.js";
import { say } from "../shared/language.js";
import { ordinal } from "./questions.js";

/** @typedef {import("./question_form.js").Drawn} Drawn */

/** Dragging this close to an edge of the panel scrolls it, by this much a movement. In CSS pixels. */
const EDGE = 56;
const SCROLL = 14;

/**
 * The place in which something that is dragged to `y` comes to stand.
 *
 * @param {number[]} middles the vertical middle of each line, in order
 * @param {number} from its place now
 * @param {number} y
 */
export function placeAt(middles, from, y) {
  const others = middles.filter((_, place) => place !== from);
  return others.filter((middle) => middle < y).length;
}

/**
 * @param {import("./questions.js").RankingAnswer} answer
 * @param {HTMLElement} heading
 * @param {() => void} changed
 * @returns {Drawn}
 */
export function drawRanking(answer, heading, changed) {
  const list = make("ol", { className: "ranking" });
  const heard = make("p", { className: "visually-hidden", "aria-live": "polite" });
  const confirm = make("button", { type: "button", className: "confirm primary" }, say("order-right"));
  const about = make("p", { className: "about" }, say("order-help"));
  confirm.onclick = () => {
    answer.confirm();
    changed();
  };
  let drawnOrder = "";

  /**
   * @param {number} from
   * @param {number} to
   */
  function move(from, to) {
    const setting = answer.move(from, to);
    changed();
    setText(heard, say("order-moved", { setting, place: to + 1, places: answer.order.length }));
  }

  /**
   * @param {string} name
   * @param {string} label
   * @param {string} sign
   * @param {number} from
   * @param {number} to
   */
  function mover(name, label, sign, from, to) {
    const disabled = to < 0 || to >= answer.order.length || to === from;
    const button = make("button", { type: "button", className: name, "aria-label": label, disabled }, sign);
    button.onclick = () => {
      move(from, to);
      focusOn(to, name);
    };
    return button;
  }

  /**
   * The focus follows a setting that was moved, to the same button or, at an end of the list, to the other arrow.
   *
   * @param {number} place
   * @param {string} name
   */
  function focusOn(place, name) {
    const line = list.children[place];
    /** @type {HTMLElement | null | undefined} */
    const wanted = line?.querySelector(`.${name}:enabled`) ?? line?.querySelector("button:enabled");
    wanted?.focus();
  }

  function draw() {
    confirm.hidden = answer.confirmed;
    const order = JSON.stringify(answer.order);
    if (order === drawnOrder) return;
    drawnOrder = order;
    list.replaceChildren(...answer.order.map(line));
  }

  /**
   * @param {number} setting
   * @param {number} index
   */
  function line(setting, index) {
    const number = ordinal(index + 1);
    const place = index === 0 ? say("place-best", { place: number }) : number;
    const handle = make(
      "span",
      { className: "place" },
      make("span", { className: "grip", "aria-hidden": "true" }, "⠿"),
      place,
    );
    const words = answer.saidOf(setting);
    const item = make(
      "li",
      {},
      handle,
      make(
        "span",
        { className: "what" },
        say("setting-number", { setting }),
        words !== "" && make("span", { className: "said", dir: "auto" }, words),
      ),
      mover("up", say("move-up", { setting }), "↑", index, index - 1),
      mover("down", say("move-down", { setting }), "↓", index, index + 1),
      mover("top", say("move-first", { setting }), "⤒", index, 0),
    );
    drag(item, handle, index);
    return item;
  }

  /**
   * @param {HTMLElement} item
   * @param {HTMLElement} handle
   * @param {number} from
   */
  function drag(item, handle, from) {
    /** @type {{ y: number, scrolled: number, middles: number[], to: number } | null} */
    let held = null;
    const panel = () => list.closest(".panel");

    handle.addEventListener("pointerdown", (event) => {
      if (!event.isPrimary || event.button !== 0) return;
      handle.setPointerCapture(event.pointerId);
      const middles = [...list.children].map((line) => {
        const { top, height } = line.getBoundingClientRect();
        return top + height / 2;
      });
      held = { y: event.clientY, scrolled: panel()?.scrollTop ?? 0, middles, to: from };
      item.classList.add("dragged");
    });
    handle.addEventListener("pointermove", ({ clientY }) => {
      if (!held) return;
      scrollAtEdge(panel(), clientY);
      const moved = clientY - held.y + (panel()?.scrollTop ?? 0) - held.scrolled;
      item.style.transform = `translateY(${moved}px)`;
      held.to = placeAt(held.middles, from, (held.middles[from] ?? 0) + moved);
      showGap(held.to);
    });
    handle.addEventListener("pointerup", () => {
      const to = held?.to ?? from;
      release();
      if (to !== from) move(from, to);
    });
    handle.addEventListener("pointercancel", release);

    function release() {
      held = null;
      item.classList.remove("dragged");
      item.style.transform = "";
      showGap(from);
    }

    /** @param {number} to marks the line before or after which the dragged one will stand */
    function showGap(to) {
      for (const [place, line] of [...list.children].entries()) {
        line.classList.toggle("before", place === to && to < from);
        line.classList.toggle("after", place === to && to > from);
      }
    }
  }

  return { nodes: [heading, about, list, heard, confirm], draw };
}

/**
 * @param {Element | null} panel
 * @param {number} y
 */
function scrollAtEdge(panel, y) {
  if (!panel) return;
  const { top, bottom } = panel.getBoundingClientRect();
  if (y < top + EDGE) panel.scrollTop -= SCROLL;
  else if (y > bottom - EDGE) panel.scrollTop += SCROLL;
}
