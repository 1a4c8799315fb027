// Exposure, gain and frame rate of a camera that lets them be changed: their units, steps and
// bounds.

/**
 * Exposure is sent in microseconds and shown in milliseconds. A third of a stop is a photographer's
 * step.
 */
const THIRD_OF_A_STOP = 2 ** (1 / 3);

/**
 * A value just asked for counts as the setting's until the camera has answered, so that quick taps
 * add up.
 */
export const SETTLED_MS = 2000;

/**
 * @typedef {object} Kind
 * @property {string} label
 * @property {string} unit
 * @property {number} per what the server counts in, per unit that is shown
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
 * A value as it is shown, in the unit that is shown.
 *
 * @param {Api.Setting} setting
 * @param {number} value
 */
export function shown(setting, value) {
  return String(Number((value / KINDS[setting].per).toPrecision(4)));
}

/**
 * What was typed, as the server counts it; NaN where that is not a number.
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

/** The camera's settings as it offers them, and values that it has been asked for. */
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
   * The value one step from the present one, within the bounds; null where the camera does not
   * offer the setting.
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
   * The camera is asked for `value`. Returns what forgets that.
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
   * Why a value was refused: the bounds, in the unit that is shown.
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
