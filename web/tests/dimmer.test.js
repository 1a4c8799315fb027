import assert from "node:assert/strict";
import { test } from "node:test";

import { brightnessOf } from "../static/surgeon/dimmer.js";

test("the page is never dimmed until nothing can be read, whatever was kept", () => {
  assert.deepEqual(
    [null, "45", "100", "0", "nonsense", "900"].map(brightnessOf),
    [100, 45, 100, 100, 100, 100],
  );
});
