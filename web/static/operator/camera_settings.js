// Exposure, gain and frame rate of a camera where they can be changed: their units, steps and bounds.

/**
 * Exposure is sent in microseconds and shown in milliseconds. It changes by a third of a stop, the usual step in
 * photography.
 */
const THIRD_OF_A_STOP = 2 ** (1 / 3);

/**
 * A requested value counts as the setting's value for this long, until the camera has reported it. So quick taps add
 * up.
 */
export const SETTLED_MS = 2000;

/**
 * @typedef {object} Kind
 * @property {string} label
 * @property {string} unit
 * @property {number} per the server's units per displayed unit
 * @property {(value: number) => number} less
 * @property {(value: number) => number} more
 */

/** @type {Record<Api.Setting, Kind>} */
export const KINDS = {
  exposure: {
    label: "Exposure",
    unit: "ms",
    per: 1000,
    less: (value) => value / THIRD_OF_A_STOP,
    more: (value) => value * THIRD_OF_A_STOP,
  },
  gain: { label: "Gain", unit: "", per: 1, less: (value) => value - 1, more: (value) => value + 1 },
  "frame-rate": {
    label: "Frame rate",
    unit: "fps",
    per: 1,
    less: (value) => value - 1,
    more: (value) => value + 1,
  },
};

/**
 * The server's `value` as displayed text, in the displayed unit.
 *
 * @param {Api.Setting} setting
 * @param {number} value
 */
export function shown(setting, value) {
  return String(Number((value / KINDS[setting].per).toPrecision(4)));
}

/**
 * The typed value in the server's unit; NaN if `text` is not a number.
 *
 * @param {Api.Setting} setting
 * @param {string} text
 */
export function typed(setting, text) {
  return text.trim() === "" ? Number.NaN : Number(text) * KINDS[setting].per;
}

/** @param {Api.Setting} setting */
export function labelOf(setting) {
  const { label, unit } = KINDS[setting];
  return unit ? `${label}, ${unit}` : label;
}

/** The settings that the camera offers, and the values just requested. */
export class CameraSettings {
  /** @type {Api.Adjustable[]} */
  offered = [];
  /** @type {Map<Api.Setting, number>} */
  #asked = new Map();

  /** @param {Api.Setting} setting */
  find(setting) {
    return this.offered.find((one) => one.setting === setting);
  }

  /**
   * The value one step from the present one, within the bounds; null if the camera does not offer the setting.
   *
   * @param {Api.Setting} setting
   * @param {"less" | "more"} direction
   */
  step(setting, direction) {
    const now = this.find(setting);
    if (!now) return null;
    const next = KINDS[setting][direction](this.#asked.get(setting) ?? now.value);
    return Math.min(Math.max(next, now.min), now.max);
  }

  /**
   * Notes that `value` was requested. Returns a function that forgets the request.
   *
   * @param {Api.Setting} setting
   * @param {number} value
   */
  ask(setting, value) {
    this.#asked.set(setting, value);
    return () => {
      if (this.#asked.get(setting) === value) this.#asked.delete(setting);
    };
  }

  /**
   * Says why a value was refused: names the bounds, in the displayed unit.
   *
   * @param {Api.Setting} setting
   */
  boundsWords(setting) {
    const now = this.find(setting);
    if (!now) return "The camera does not offer this setting now.";
    const { label, unit } = KINDS[setting];
    const bounds = `${label} must be from ${shown(setting, now.min)} to ${shown(setting, now.max)} ${unit}`;
    return `${bounds.trimEnd()}.`;
  }
}
