/** Mark robots whose reports are outdated. */

import type { Thing } from "./thing";
import { RobotThing } from "./things/robot";

/** Time between two checks, ms. */
const PERIOD = 250;

/** Check until the returned function is called. After the page was suspended, waiting reports are handled first. */
export function checkAges(things: ReadonlyMap<string, Thing>, onOutdated: () => void): () => void {
  let checkedAt = 0;
  const timer = setInterval(() => {
    const now = performance.now();
    const paused = now - checkedAt > 2 * PERIOD;
    checkedAt = now;
    if (paused) return;
    for (const thing of things.values()) if (thing instanceof RobotThing && thing.checkAge()) onOutdated();
  }, PERIOD);
  return () => clearInterval(timer);
}
