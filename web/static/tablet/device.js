// The tablet's name: the same random one that the surgeon's page uses.

import { uuid } from "../shared/uuid.js";

const DEVICE = "parfocal.device";

/** @param {import("../shared/storage.js").Store} store */
export function device(store) {
  const known = store.read(DEVICE);
  if (known) return known;
  const made = uuid();
  store.write(DEVICE, made);
  return made;
}
