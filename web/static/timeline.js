// A session's timeline as SVG: segments shaded, focal power over time, a marker for each comment.

const SVG = "http://www.w3.org/2000/svg";
const HEIGHT = 260;
const EDGE = { left: 44, right: 12, top: 42, bottom: 26 };

/**
 * Draws into `figure`. `data` is `{ seconds, segments: [{ setting, from, to, policy }], comments: [{ at, kind, text, setting }] }`,
 * times in seconds from the start of the session; `path` is `[[seconds, focalPower], ...]` with `null` where the path
 * breaks, or null. `choose(index)` is called when a marker is pointed at or tapped.
 */
export function drawTimeline(figure, data, path, choose) {
  const width = Math.max(figure.clientWidth, 320);
  const total = Math.max(data.seconds, 1);
  const x = (seconds) => EDGE.left + (seconds / total) * (width - EDGE.left - EDGE.right);
  const y = (power) => HEIGHT - EDGE.bottom - power * (HEIGHT - EDGE.top - EDGE.bottom);
  const svg = shape("svg", { viewBox: `0 0 ${width} ${HEIGHT}`, role: "img", "aria-label": description(data, path) });
  svg.append(...segments(data.segments, x, y), ...axes(total, width, x, y, path !== null));
  if (path) svg.append(shape("path", { class: "path", d: trace(path, x, y) }));
  const heights = data.comments.map((comment) => y(path ? valueAt(path, comment.at) : 0.5));
  const markers = data.comments.map((comment, index) => marker(comment, x(comment.at), heights[index], y(0), () => choose(index)));
  svg.append(...markers);
  const caption = document.createElement("figcaption");
  figure.replaceChildren(svg, caption);
  return (index) => point(figure, caption, markers, data.comments[index], index, x(data.comments[index].at), heights[index]);
}

function shape(tag, attributes, text) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  return element;
}

function segments(list, x, y) {
  return list.flatMap(({ setting, from, to, policy }) => {
    const wide = x(to) - x(from);
    const box = { x: x(from), y: y(1), width: Math.max(wide, 1), height: y(0) - y(1) };
    const name = shape("text", { class: "segment-name", x: box.x + 6, y: y(1) - 22 }, wide > 70 ? `Setting ${setting}` : `${setting}`);
    const ran = policy && wide > 70 ? [shape("text", { class: "policy", x: box.x + 6, y: y(1) - 6 }, policy)] : [];
    return [shape("rect", { class: `segment ${setting % 2 ? "odd" : ""}`, ...box }), name, ...ran];
  });
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

function trace(path, x, y) {
  let pen = "M";
  return path
    .map((sample) => {
      if (sample === null) {
        pen = "M";
        return "";
      }
      const command = `${pen}${x(sample[0]).toFixed(1)} ${y(sample[1]).toFixed(1)}`;
      pen = "L";
      return command;
    })
    .join("");
}

function valueAt(path, seconds) {
  let nearest = [0, 0.5];
  for (const sample of path) {
    if (sample !== null && Math.abs(sample[0] - seconds) < Math.abs(nearest[0] - seconds)) nearest = sample;
  }
  return nearest[1];
}

function marker(comment, cx, cy, foot, choose) {
  const group = shape("g", { class: `marker ${comment.kind}` });
  group.append(shape("line", { class: "stem", x1: cx, x2: cx, y1: cy, y2: foot }), shape("circle", { cx, cy, r: 6 }), shape("circle", { class: "hit", cx, cy, r: 20 }));
  group.addEventListener("pointerenter", choose);
  group.addEventListener("click", choose);
  return group;
}

function point(figure, caption, markers, comment, index, cx, cy) {
  markers.forEach((each, other) => each.classList.toggle("chosen", other === index));
  caption.textContent = comment.text ?? "Marked this moment";
  const left = Math.min(Math.max(cx - caption.offsetWidth / 2, 0), Math.max(figure.clientWidth - caption.offsetWidth, 0));
  caption.style.left = `${left}px`;
  caption.style.top = `${cy > HEIGHT / 2 ? cy - caption.offsetHeight - 14 : cy + 14}px`;
}

function description(data, path) {
  const what = path ? "Focal power over time" : "Timeline";
  return `${what}: ${data.segments.length} settings, ${data.comments.length} comments. The comments follow as a list.`;
}
