/** Devices of the online scene that cannot be controlled because a setting is missing. */

import { type Uncontrolled, uncontrolled } from "../../program/settings";
import { stable } from "../../store/memo";
import type { State } from "../../store/state";

/** Return the same list while it does not change. */
export const uncontrolledOnline: (state: State) => Uncontrolled[] = stable(
  ({ doc, types, live }) => (live.state === "started" ? uncontrolled(doc, types.byName, live.objects) : []),
  (one, other) => JSON.stringify(one) === JSON.stringify(other),
);
