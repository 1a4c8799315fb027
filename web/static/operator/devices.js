// The devices' health as the operator sees it: a lamp each, and every warning as a sentence that says what to do.

import { make, redraw } from "../shared/dom.js";

/** Draws a lamp for camera, lens and loop into `list`. */
export function drawDevices(list, status) {
  const hidden = status.latency_p50_micros === null;
  const latency = hidden ? "timing hidden" : `${milliseconds(status.latency_p50_micros)} ms median, ${milliseconds(status.latency_p99_micros)} ms p99`;
  const loop = `${status.steps_per_second.toFixed(0)} steps/s · ${latency}`;
  redraw(list, [
    lamp(status.camera.name, `${status.camera.fps.toFixed(1)} fps${status.camera.lost > 0 ? ` · ${status.camera.lost} lost` : ""}`, status.camera.working ? (status.camera.simulated ? "warn" : "") : "bad", status.camera.message),
    lamp(status.lens.name, status.lens.working ? "" : "not answering", status.lens.working ? (status.lens.simulated || status.lens.caution ? "warn" : "") : "bad", status.lens.message),
    lamp("focus loop", loop, status.held && status.held !== "paused" ? "bad" : "", status.message ?? ""),
  ]);
}

/** What camera, lens and loop say of themselves, into the list of terms `list`. */
export function drawDeviceWords(list, { camera, lens, priority }) {
  const one = (term, { name, message }) => [make("dt", {}, term), make("dd", {}, make("span", {}, `${name}: `), make("span", { className: "muted" }, message))];
  const loop = [make("dt", {}, "Focus loop"), make("dd", { className: "muted" }, priority.message)];
  redraw(list, [...one("Camera", camera), ...one("Lens", lens), ...loop]);
}

const milliseconds = (micros) => (micros / 1000).toFixed(2);

function lamp(name, figure, state, title) {
  return make("li", { className: `badge ${state}`, title }, make("span", { className: "lamp", "aria-hidden": "true" }), make("span", { className: "name" }, name), figure && make("span", { className: "number" }, figure));
}

/** Draws one line a warning into `box`. */
export function drawWarnings(box, status) {
  const lines = [];
  const warn = (text, level = "warn") => lines.push(make("p", { className: `notice-line ${level}` }, text));
  // One trouble, one line: a failed camera or lens is also why the focus is held.
  const cameraHolds = status.held === "camera-failed";
  const lensHolds = status.held === "lens-failed" && !status.lens.working;
  if (!status.camera.working) warn(`Camera: ${cameraHolds ? status.message : status.camera.message}`, "bad");
  if (!status.lens.working) warn(`Lens: ${status.lens.message}`, "bad");
  else if (status.lens.caution) warn(`Lens: ${status.lens.message}`);
  const otherwise = status.held && status.held !== "paused" && !cameraHolds && !lensHolds;
  if (otherwise) warn(`Focus loop: ${status.message ?? "the lens is being held where it is."}`, "bad");
  const simulated = [status.camera.simulated && "camera", status.lens.simulated && "lens"].filter(Boolean);
  if (simulated.length > 0) warn(`Simulated ${simulated.join(" and ")}: this is not a real instrument.`);
  if (status.telemetry_dropped > 0) warn(`${status.telemetry_dropped} telemetry records were dropped: the disk cannot keep up. Comments and answers are not affected.`);
  redraw(box, lines);
}
