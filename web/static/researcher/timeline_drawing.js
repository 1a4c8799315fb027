// A session's timeline as SVG: segments shaded, pauses hatched, focal power over time, a marker for each comment, and one for
// each answer that does not count.

const SVG = "http://www.w3.org/2000/svg";
const HEIGHT = 260;
const EDGE = { left: 44, right: 12, top: 42, bottom: 26 };

/**
 * Draws the server's `timeline` into `figure`; the focal path only `withPath`, since it may tell policies apart.
 * `choose(index)` is called when a comment's marker is pointed at or tapped. Returns a function that points out a comment.
 */
export function drawTimeline(figure, timeline, { withPath, policies, choose }) {
  const width = Math.max(figure.clientWidth, 320);
  const total = length(timeline);
  const x = (seconds) => EDGE.left + (seconds / total) * (width - EDGE.left - EDGE.right);
  const y = (power) => HEIGHT - EDGE.bottom - power * (HEIGHT - EDGE.top - EDGE.bottom);
  const points = withPath ? timeline.points : [];
  const svg = shape("svg", { viewBox: `0 0 ${width} ${HEIGHT}`, role: "img", "aria-label": description(timeline, withPath) });
  svg.append(...settings(timeline.settings, policies, total, x, y), ...pauses(timeline.pauses, total, x, y), ...axes(total, width, x, y, withPath));
  svg.append(shape("path", { class: "optimum", d: trace(points, (point) => point.optimal, x, y) }));
  svg.append(shape("path", { class: "path", d: trace(points, powerOf, x, y) }));
  const heights = timeline.comments.map((comment) => y(powerAt(points, comment.seconds)));
  const markers = timeline.comments.map((comment, index) => marker(comment, x(comment.seconds), heights[index], y(0), () => choose(index)));
  svg.append(...markers, ...timeline.set_aside.map((answer) => asideMarker(answer, x(answer.seconds), y(1) + 10)));
  const caption = document.createElement("figcaption");
  figure.replaceChildren(svg, caption);
  return (index) => point(figure, caption, markers, timeline.comments[index], index, x(timeline.comments[index].seconds), heights[index]);
}

/** Seconds from the start to the last thing that happened. */
function length({ settings, pauses, points, comments, set_aside: aside }) {
  const ends = [...[...settings, ...pauses].map(({ from, to }) => to ?? from), ...[...comments, ...aside].map(({ seconds }) => seconds)];
  return Math.max(1, points.at(-1)?.seconds ?? 0, ...ends);
}

const powerOf = (point) => point.measured ?? point.asked;

function shape(tag, attributes, text) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

function settings(list, policies, total, x, y) {
  return list.flatMap(({ setting, from, to }) => {
    const box = { x: x(from), y: y(1), width: Math.max(x(to ?? total) - x(from), 1), height: y(0) - y(1) };
    const roomy = box.width > 70;
    const name = shape("text", { class: "segment-name", x: box.x + 6, y: y(1) - 22 }, roomy ? `Setting ${setting}` : setting);
    const policy = policies[setting - 1];
    // A name that would leave the picture ends with it.
    const place = x(total) - box.x < 130 ? { x: x(total), "text-anchor": "end" } : { x: box.x + 6 };
    const ran = policy && roomy ? [shape("text", { class: "policy", y: y(1) - 6, ...place }, policy)] : [];
    return [shape("rect", { class: `segment ${setting % 2 ? "odd" : ""}`, ...box }), name, ...ran];
  });
}

/** Hatched: the lens stood where it was, whatever was to drive it. */
function pauses(list, total, x, y) {
  if (list.length === 0) return [];
  const hatch = shape("pattern", { id: "hatch", width: 8, height: 8, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" });
  hatch.append(shape("rect", { width: 2, height: 8 }));
  const boxes = list.map(({ from, to, reason }) => {
    const box = shape("rect", { class: "pause", x: x(from), y: y(1), width: Math.max(x(to ?? total) - x(from), 2), height: y(0) - y(1) });
    box.append(shape("title", {}, reason));
    return box;
  });
  return [hatch, ...boxes];
}

function axes(total, width, x, y, withPower) {
  const parts = [shape("line", { class: "axis", x1: EDGE.left, x2: width - EDGE.right, y1: y(0), y2: y(0) })];
  if (withPower) {
    for (const power of [0, 0.5, 1]) parts.push(shape("text", { class: "tick", x: EDGE.left - 8, y: y(power) + 4, "text-anchor": "end" }, power.toFixed(1)));
    parts.push(shape("text", { class: "tick", x: 0, y: 14 }, "focal power"));
  }
  const step = [5, 10, 15, 30, 60, 120, 300, 600].find((seconds) => total / seconds <= width / 90) ?? 900;
  for (let seconds = 0; seconds <= total; seconds += step) {
    const text = `${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, "0")}`;
    parts.push(shape("text", { class: "tick", x: x(seconds), y: HEIGHT - 6, "text-anchor": "middle" }, text));
  }
  return parts;
}

/** A line through `value` of each point, broken between settings, where there is none, and where frames were counted anew. */
function trace(points, value, x, y) {
  let before = null;
  return points
    .map((point) => {
      if (value(point) === null) return (before = null), "";
      const goesOn = before?.setting === point.setting && before.frame < point.frame;
      before = point;
      return `${goesOn ? "L" : "M"}${x(point.seconds).toFixed(1)} ${y(value(point)).toFixed(1)}`;
    })
    .join("");
}

/** Focal power at about `seconds`; the middle where the path is not drawn. */
function powerAt(points, seconds) {
  let nearest = null;
  for (const point of points) {
    if (nearest === null || Math.abs(point.seconds - seconds) < Math.abs(nearest.seconds - seconds)) nearest = point;
  }
  return nearest ? powerOf(nearest) : 0.5;
}

function marker(comment, cx, cy, foot, choose) {
  const group = shape("g", { class: `marker ${comment.kind}` });
  group.append(shape("line", { class: "stem", x1: cx, x2: cx, y1: cy, y2: foot }), shape("circle", { cx, cy, r: 6 }), shape("circle", { class: "hit", cx, cy, r: 20 }));
  group.addEventListener("pointerenter", choose);
  group.addEventListener("click", choose);
  return group;
}

/** A diamond for an answer that does not count. */
function asideMarker(answer, cx, cy) {
  const diamond = shape("path", { class: "aside", d: `M${cx} ${cy - 7} l7 7 l-7 7 l-7 -7 z` });
  diamond.append(shape("title", {}, `${answer.text || answer.question} ${whyAside(answer)}`));
  return diamond;
}

/** What an answer that does not count says, and why it does not. */
export function whyAside({ value, counted, late }) {
  const words = (given) => [given].flat().map((part) => (part === 0 ? "–" : part)).join(", ");
  const instead = counted === null ? "" : `; ${words(counted)} counts`;
  return `${words(value)} (${late ? "arrived too late" : "another device’s later answer differs"}${instead})`;
}

function point(figure, caption, markers, comment, index, cx, cy) {
  markers.forEach((each, other) => each.classList.toggle("chosen", other === index));
  caption.textContent = comment.text ?? "Marked this moment";
  const left = Math.min(Math.max(cx - caption.offsetWidth / 2, 0), Math.max(figure.clientWidth - caption.offsetWidth, 0));
  caption.style.left = `${left}px`;
  caption.style.top = `${cy > HEIGHT / 2 ? cy - caption.offsetHeight - 14 : cy + 14}px`;
}

function description({ settings, pauses, comments, set_aside: aside }, withPath) {
  const held = pauses.length > 0 ? ` ${pauses.length} ${pauses.length > 1 ? "pauses" : "pause"},` : "";
  const apart = aside.length > 0 ? ` ${aside.length} ${aside.length > 1 ? "answers that do" : "answer that does"} not count,` : "";
  return `${withPath ? "Focal power over time" : "Time line"}: ${settings.length} settings,${held}${apart} ${comments.length} comments, which follow as a list.`;
}
