// Applies the input on an element (fingers, mouse, wheel, keys) to the framing of its picture.

import { Gestures } from "./gestures.js";

/** A key zooms by this factor, or moves by this fraction of the box. */
const KEY_ZOOM = 1.25;
const KEY_MOVE = 0.1;

/**
 * Logarithm of the zoom for each CSS pixel of the wheel; CSS pixels of a line and of a page. A pinch on a touchpad
 * comes as a wheel event with Ctrl.
 */
const WHEEL = 0.0015;
const TOUCHPAD_PINCH = 0.01;
const LINE = 40;
const PAGE = 400;

/** @type {Record<string, [number, number]>} */
const ARROWS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/**
 * What keys do with the place that is pointed at.
 *
 * @typedef {object} Nudged
 * @property {(across: number, down: number) => void} nudge
 * @property {() => void} centre
 * @property {() => void} set
 * @property {() => boolean} takesArrows whether arrows point and arrows with Shift move the picture, or the other way
 *   round
 */

/**
 * Lets people zoom `framing` by input on `element`. Calls `changed` after each change.
 *
 * @param {HTMLElement} element
 * @param {import("./framing.js").Framing} framing
 * @param {() => void} changed
 * @param {import("./gestures.js").Tappable & Nudged} taps
 */
export function followZooming(element, framing, changed, taps) {
  const gestures = new Gestures(framing, taps);
  const pointOf = (/** @type {MouseEvent} */ event) => {
    const box = element.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };

  element.addEventListener("pointerdown", (event) => {
    const onButton = event.target instanceof Element && event.target.closest("button");
    if (onButton || (event.pointerType === "mouse" && event.button !== 0)) return;
    // A finger that leaves the element still drags.
    element.setPointerCapture(event.pointerId);
    gestures.down(event.pointerId, pointOf(event), event.timeStamp);
  });
  element.addEventListener("pointermove", (event) => {
    gestures.move(event.pointerId, pointOf(event));
    changed();
  });
  element.addEventListener("pointerup", (event) => {
    gestures.up(event.pointerId, pointOf(event), event.timeStamp);
    changed();
  });
  element.addEventListener("pointercancel", (event) => gestures.cancel(event.pointerId));

  const wheel = (/** @type {WheelEvent} */ event) => {
    const unit = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? LINE : event.deltaMode ? PAGE : 1;
    const before = framing.zoom;
    framing.zoomBy(Math.exp(-event.deltaY * unit * (event.ctrlKey ? TOUCHPAD_PINCH : WHEEL)), pointOf(event));

    // A wheel event that does not zoom scrolls the page.
    if (event.ctrlKey || framing.zoom !== before) event.preventDefault();
    changed();
  };
  element.addEventListener("wheel", wheel, { passive: false });

  element.addEventListener("keydown", (event) => {
    if (event.target !== element || event.ctrlKey || event.metaKey || event.altKey) return;
    const key = ARROWS[event.key];
    const points = event.shiftKey !== taps.takesArrows() ? key : undefined;
    const arrow = framing.zoom > 1 ? key : undefined;

    if (points) taps.nudge(-points[0], -points[1]);
    else if (event.key === "Enter") taps.set();
    else if (event.key === "c" || event.key === "C") taps.centre();
    else if (event.key === "+" || event.key === "=") framing.zoomBy(KEY_ZOOM);
    else if (event.key === "-") framing.zoomBy(1 / KEY_ZOOM);
    else if (event.key === "0") framing.reset();
    else if (arrow) {
      framing.moveBy(arrow[0] * KEY_MOVE * element.clientWidth, arrow[1] * KEY_MOVE * element.clientHeight);
    } else return;

    event.preventDefault();
    changed();
  });
}
