// The texts about the devices' health: a lamp for each, and for every warning a sentence that says what to do.

/** @typedef {Stream.OperatorStatus} Status */
/** @typedef {{ name: string, figure: string, level: "" | "warn" | "bad", title: string }} Lamp */
/** @typedef {{ text: string, level: "warn" | "bad" }} Warning */

/** Holds that people asked for: no trouble. @type {(string | null)[]} */
const ON_REQUEST = ["paused", "focus-held"];

/**
 * Whether the focus is held although nobody asked for it.
 *
 * @param {Pick<Status, "held">} status
 */
function isHeldInTrouble({ held }) {
  return held !== null && !ON_REQUEST.includes(held);
}

/** @param {number} micros */
function milliseconds(micros) {
  return (micros / 1000).toFixed(2);
}

/**
 * The lamps for camera, lens and loop.
 *
 * @param {Status} status
 * @returns {Lamp[]}
 */
export function lamps(status) {
  const { camera, lens } = status;
  const lost = camera.lost > 0 ? ` · ${camera.lost} lost since the server’s start` : "";

  return [
    {
      name: camera.name,
      figure: `${camera.fps.toFixed(1)} fps${lost}`,
      level: level(camera.working, camera.simulated),
      title: camera.message,
    },
    {
      name: lens.name,
      figure: lens.working ? "" : "not answering",
      level: level(lens.working, lens.simulated || lens.caution),
      title: lens.message,
    },
    {
      name: "focus loop",
      figure: `${status.steps_per_second.toFixed(0)} steps/s · ${latencyWords(status)}`,
      level: isHeldInTrouble(status) ? "bad" : "",
      title: status.message ?? "",
    },
    tabletLamp(status.tablet),
  ];
}

/**
 * @param {Stream.TabletSign} tablet
 * @returns {Lamp}
 */
function tabletLamp({ presence, away_seconds: away, slow, size }) {
  const name = "surgeon’s tablet";
  const title = "The tablet that shows the surgeon’s page";
  switch (presence) {
    case "present": {
      const figure = size === null ? "" : `${size.width}×${size.height}${slow ? ", reduced" : ""}`;
      return { name, figure, level: slow ? "warn" : "", title };
    }
    case "hidden":
      return { name, figure: "not on screen", level: "bad", title };
    case "silent":
      return { name, figure: `silent for ${away ?? 0} s`, level: "bad", title };
    case "never-seen":
      return { name, figure: "not open yet", level: "warn", title };
  }
}

/**
 * @param {boolean} working
 * @param {boolean} warn
 */
function level(working, warn) {
  if (!working) return "bad";
  return warn ? "warn" : "";
}

/** @param {Status} status */
function latencyWords({ latency_p50_micros: median, latency_p99_micros: p99 }) {
  if (median === null || p99 === null) return "timing hidden";
  return `${milliseconds(median)} ms median, ${milliseconds(p99)} ms p99`;
}

/**
 * One warning for each problem. If the focus is held because the camera or the lens failed, that gives one warning, not
 * two.
 *
 * @param {Status} status
 * @param {boolean} inSession whether a session has started and not ended
 * @returns {Warning[]}
 */
export function warnings(status, inSession) {
  const { camera, lens, held, tablet } = status;
  const cameraHolds = held === "camera-failed";
  const lensHolds = held === "lens-failed" && !lens.working;
  /** @type {Warning[]} */
  const all = [];

  if (inSession && tablet.presence === "silent") {
    const text = `The surgeon’s tablet has not answered for ${tablet.away_seconds ?? 0} s. Look after it, or pause.`;
    all.push({ text, level: "bad" });
  }
  if (inSession && tablet.presence === "hidden") {
    const text = "The surgeon’s page is not on screen. Bring it to the front of the tablet, or pause.";
    all.push({ text, level: "bad" });
  }
  if (!camera.working) {
    all.push({ text: `Camera: ${cameraHolds ? status.message : camera.message}`, level: "bad" });
  }
  if (!lens.working) all.push({ text: `Lens: ${lens.message}`, level: "bad" });
  else if (lens.caution) all.push({ text: `Lens: ${lens.message}`, level: "warn" });

  if (isHeldInTrouble(status) && !cameraHolds && !lensHolds) {
    const message = status.message ?? "the lens is held where it is.";
    all.push({ text: `Focus loop: ${message}`, level: "bad" });
  }

  const simulated = [camera.simulated && "camera", lens.simulated && "lens"].filter(Boolean);
  if (simulated.length > 0) {
    all.push({ text: `Simulated ${simulated.join(" and ")}: this is not a real instrument.`, level: "warn" });
  }
  if (status.telemetry_dropped > 0) {
    const dropped = `${status.telemetry_dropped} telemetry records were lost because the disk is too slow.`;
    all.push({ text: `${dropped} Comments and answers are not affected.`, level: "warn" });
  }
  return all;
}
