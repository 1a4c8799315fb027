// Draws the focus metric over time, below the timeline. Each policy has its own metric, so each setting has its own
// scale. Values can be compared only within a setting.

import { shape } from "../shared/svg.js";
import { movePlayhead, playheadLine } from "./playhead_line.js";
import { metricPath, Scale } from "./timeline.js";

const METRIC_HEIGHT = 96;
const TOP = 8;
const BOTTOM = METRIC_HEIGHT - 8;

/**
 * Draws the metric of `timeline` into `figure`. Returns a function that moves the playhead.
 *
 * @param {HTMLElement} figure
 * @param {Api.Timeline} timeline
 * @param {Scale} scale the timeline's
 * @returns {(seconds: number) => void}
 */
export function drawMetric(figure, timeline, scale) {
  const svg = shape("svg", {
    viewBox: `0 0 ${scale.width} ${METRIC_HEIGHT}`,
    role: "img",
    "aria-label": "The focus metric over time, each setting by a scale of its own",
  });

  const playhead = playheadLine({ top: 0, bottom: BOTTOM });
  svg.append(
    ...timeline.settings.map((setting) => {
      const { x, width } = scale.box(setting, 1);
      const odd = setting.setting % 2 ? "odd" : "";
      return shape("rect", { class: `segment ${odd}`, x, width, y: 0, height: BOTTOM });
    }),
    shape("line", { class: "axis", x1: scale.left, x2: scale.right, y1: BOTTOM, y2: BOTTOM }),
    shape("text", { class: "tick", x: 0, y: 14 }, "metric"),
    shape("path", { class: "metric", d: metricPath(timeline.points, scale, TOP, BOTTOM) }),
    playhead,
  );

  figure.replaceChildren(svg);
  return (seconds) => movePlayhead(playhead, scale.x(seconds));
}
