// Draws a session's timeline as SVG: settings shaded, pauses hatched, focal power over time, a marker for each comment,
// and one for each answer that does not count.

import { make } from "../shared/dom.js";
import { shape } from "../shared/svg.js";
import { clockText } from "../shared/text.js";
import { movePlayhead, playheadLine } from "./playhead_line.js";
import { HEIGHT, linePath, powerAt, powerOf, Scale } from "./timeline.js";
import { choiceWords, commentWords, description, setAsideWords, sightWords } from "./timeline_words.js";

/** The height of the strip that marks what was recorded, in pixels. */
const STRIP = 4;

/** The height of the strip for the largest picture that a surgeon can see, in pixels, and the width of that picture. */
const SIGHT = 8;
const WIDEST = 2048;

/** A setting narrower than this, in pixels, shows its number alone. */
const ROOM_FOR_A_NAME = 70;
const POLICY_NAME_WIDTH = 130;

/** @typedef {Api.Timeline} Timeline */
/** @typedef {{ group: Element, x: number, y: number }} Marker */

/**
 * Draws `timeline` into `figure`.
 *
 * @param {HTMLElement} figure
 * @param {Timeline} timeline
 * @param {object} options
 * @param {Scale} options.scale
 * @param {boolean} options.withPath whether to draw the focal path, which may reveal the policies
 * @param {string[]} options.policies the policy of each setting; empty while blinded
 * @param {{ from: number, to: number }[]} options.recorded the spans of time that were recorded
 * @param {string} options.zone the time zone of the page
 * @param {(comment: number) => void} options.choose called when a comment's marker is pointed at
 * @param {(comment: number) => void} options.jump called when a comment's marker is tapped
 * @returns {{ pointOut: (comment: number) => void, movePlayhead: (seconds: number) => void }}
 */
export function drawTimeline(figure, timeline, { scale, withPath, policies, recorded, zone, choose, jump }) {
  const points = withPath ? timeline.points : [];
  const head = scale.y(1);
  const foot = scale.y(0);
  const markers = timeline.comments.map((comment, index) => {
    const x = scale.x(comment.seconds);
    const y = scale.y(powerAt(points, comment.seconds));
    const group = commentMarker(
      comment,
      { x, y, foot },
      () => choose(index),
      () => jump(index),
    );
    return { group, x, y };
  });

  const svg = shape("svg", {
    viewBox: `0 0 ${scale.width} ${HEIGHT}`,
    role: "img",
    "aria-label": description(timeline, withPath),
  });
  const playhead = playheadLine({ top: head, bottom: foot });
  svg.append(
    ...timeline.settings.flatMap((setting) => settingShapes(setting, policies, scale)),
    ...pauseShapes(timeline.pauses, scale),
    ...timeline.sights.map((sight) => sightShape(sight, scale)),
    ...timeline.absences.map((absence) =>
      stripShape("absence", absence, scale, { y: head, height: SIGHT, least: 2, title: absence.reason }),
    ),
    ...timeline.holds.map((hold) =>
      stripShape("hold", hold, scale, { y: foot - 2 * SIGHT, height: SIGHT, least: 2, title: "Focus held" }),
    ),
    ...timeline.choices.map((choice) => choiceShape(choice, scale)),
    ...recorded.map((span) =>
      stripShape("recorded", span, scale, { y: foot - STRIP, height: STRIP, least: 1 }),
    ),
    ...axes(scale, withPath),
    shape("path", { class: "optimum", d: linePath(points, ({ optimal }) => optimal, scale) }),
    shape("path", { class: "path", d: linePath(points, powerOf, scale) }),
    playhead,
    ...markers.map(({ group }) => group),
    ...timeline.set_aside.map((answer) => setAsideMarker(answer, scale)),
  );

  const caption = make("figcaption");
  figure.replaceChildren(svg, caption);
  return {
    pointOut: (index) => pointOut(figure, caption, markers, timeline.comments, zone, index),
    movePlayhead: (seconds) => movePlayhead(playhead, scale.x(seconds)),
  };
}

/**
 * A strip over a span of time, at least `least` pixels wide.
 *
 * @param {string} kind
 * @param {{ from: number, to?: number | null }} span
 * @param {Scale} scale
 * @param {{ y: number, height: number, least: number, title?: string }} strip
 */
function stripShape(kind, span, scale, { y, height, least, title }) {
  const { x, width } = scale.box(span, least);
  const strip = shape("rect", { class: kind, x, width, y, height });
  if (title !== undefined) strip.append(shape("title", {}, title));
  return strip;
}

/**
 * A strip at the head of the plot that says in its title what size of picture the surgeon saw; the smaller, the lower.
 *
 * @param {Timeline["sights"][number]} sight
 * @param {Scale} scale
 */
function sightShape(sight, scale) {
  const height = Math.max(2, (SIGHT * sight.width) / WIDEST);
  const y = scale.y(1) + SIGHT - height;
  return stripShape("sight", sight, scale, { y, height, least: 1, title: sightWords(sight) });
}

/**
 * A ring at the foot of the plot where somebody pointed at what was to be in focus.
 *
 * @param {Timeline["choices"][number]} choice
 * @param {Scale} scale
 */
function choiceShape(choice, scale) {
  const ring = shape("circle", { class: "choice", cx: scale.x(choice.seconds), cy: scale.y(0) - 12, r: 5 });
  ring.append(shape("title", {}, choiceWords(choice)));
  return ring;
}

/**
 * @param {Timeline["settings"][number]} span
 * @param {string[]} policies
 * @param {Scale} scale
 */
function settingShapes(span, policies, scale) {
  const { setting } = span;
  const box = scale.box(span, 1);
  const isRoomy = box.width > ROOM_FOR_A_NAME;
  const name = isRoomy ? `Setting ${setting}` : String(setting);
  const shapes = [
    shape("rect", { class: `segment ${setting % 2 ? "odd" : ""}`, ...box }),
    shape("text", { class: "segment-name", x: box.x + 6, y: box.y - 22 }, name),
  ];

  const policy = policies[setting - 1];
  if (policy && isRoomy) {
    // A name that would reach beyond the drawing is aligned to its right edge.
    const leavesPicture = scale.right - box.x < POLICY_NAME_WIDTH;
    const place = leavesPicture
      ? { x: scale.right, "text-anchor": "end" }
      : { x: box.x + 6, "text-anchor": "start" };
    shapes.push(shape("text", { class: "policy", y: box.y - 6, ...place }, policy));
  }
  return shapes;
}

/**
 * Hatched boxes for the pauses. During a pause the lens stood still, no matter which policy would have driven it.
 *
 * @param {Timeline["pauses"]} pauses
 * @param {Scale} scale
 */
function pauseShapes(pauses, scale) {
  if (pauses.length === 0) return [];
  const hatch = shape("pattern", {
    id: "hatch",
    width: 8,
    height: 8,
    patternUnits: "userSpaceOnUse",
    patternTransform: "rotate(45)",
  });
  hatch.append(shape("rect", { width: 2, height: 8 }));

  const boxes = pauses.map((pause) => {
    const box = shape("rect", { class: "pause", ...scale.box(pause, 2) });
    box.append(shape("title", {}, pause.reason));
    return box;
  });
  return [hatch, ...boxes];
}

/**
 * @param {Scale} scale
 * @param {boolean} withPower
 */
function axes(scale, withPower) {
  const bottom = scale.y(0);
  const parts = [shape("line", { class: "axis", x1: scale.left, x2: scale.right, y1: bottom, y2: bottom })];
  if (withPower) {
    for (const power of [0, 0.5, 1]) {
      const place = { x: scale.left - 8, y: scale.y(power) + 4, "text-anchor": "end" };
      parts.push(shape("text", { class: "tick", ...place }, power.toFixed(1)));
    }
    // On two lines, because the first setting's name is beside it.
    parts.push(shape("text", { class: "tick", x: 0, y: 14 }, "focal"));
    parts.push(shape("text", { class: "tick", x: 0, y: 28 }, "power"));
  }

  for (const seconds of scale.ticks()) {
    const place = { x: scale.x(seconds), y: HEIGHT - 6, "text-anchor": "middle" };
    parts.push(shape("text", { class: "tick", ...place }, clockText(seconds)));
  }
  return parts;
}

/**
 * @param {Api.TimelineComment} comment
 * @param {{ x: number, y: number, foot: number }} place
 * @param {() => void} choose
 * @param {() => void} jump
 */
function commentMarker(comment, { x, y, foot }, choose, jump) {
  const group = shape("g", { class: `marker ${comment.kind}` });
  group.append(
    shape("line", { class: "stem", x1: x, x2: x, y1: y, y2: foot }),
    shape("circle", { cx: x, cy: y, r: 6 }),
    shape("circle", { class: "hit", cx: x, cy: y, r: 20 }),
  );
  group.addEventListener("pointerenter", choose);
  group.addEventListener("click", (event) => {
    // Otherwise the drawing below would seek to the moment of the comment itself.
    event.stopPropagation();
    jump();
  });
  return group;
}

/**
 * A diamond for an answer that does not count.
 *
 * @param {Api.SetAside} answer
 * @param {Scale} scale
 */
function setAsideMarker(answer, scale) {
  const cx = scale.x(answer.seconds);
  const cy = scale.y(1) + 10;
  const diamond = shape("path", { class: "aside", d: `M${cx} ${cy - 7} l7 7 l-7 7 l-7 -7 z` });
  diamond.append(shape("title", {}, `${answer.text || answer.question} ${setAsideWords(answer)}`));
  return diamond;
}

/**
 * @param {HTMLElement} figure
 * @param {HTMLElement} caption
 * @param {Marker[]} markers
 * @param {Api.TimelineComment[]} comments
 * @param {string} zone
 * @param {number} index
 */
function pointOut(figure, caption, markers, comments, zone, index) {
  const marker = markers[index];
  const comment = comments[index];
  if (!marker || !comment) return;
  for (const each of markers) each.group.classList.toggle("chosen", each === marker);

  caption.textContent = commentWords(comment, zone);
  const rightmost = Math.max(figure.clientWidth - caption.offsetWidth, 0);
  const left = Math.min(Math.max(marker.x - caption.offsetWidth / 2, 0), rightmost);
  const isLow = marker.y > HEIGHT / 2;
  caption.style.left = `${left}px`;
  caption.style.top = `${isLow ? marker.y - caption.offsetHeight - 14 : marker.y + 14}px`;
}
