/** Reachability of the targets of an action. Pure functions. */

import type { Action, Reach, ReachabilityData } from "../protocol/types";
import { decoded } from "./json";

/** Reachabilities from best to worst. */
const REACHES: readonly Reach[] = ["reachable", "near_limit", "unknown", "in_collision", "out_of_reach"];

export const worse = (a: Reach, b: Reach): boolean => REACHES.indexOf(a) > REACHES.indexOf(b);

interface ActionReach {
  reach: Reach;
  /** The reason given by the server; empty if it is reachable. */
  reason: string;
  /** Id of the worst orientation or joints among the targets. */
  goal: string;
}

/** Return the orientations and joints that are targets of an action. */
function goalsOf({ parameters }: Pick<Action, "parameters">): string[] {
  return parameters.flatMap(({ type, value }) =>
    type === "pose" || type === "joints" ? [String(decoded(value))] : [],
  );
}

/**
 * Return the reachability of an action: for each target the best end effector, of all targets the worst. Null if it is
 * unknown or there are no targets.
 */
export function reachOfAction(
  action: Pick<Action, "parameters" | "type">,
  reach: Record<string, ReachabilityData>,
): ActionReach | null {
  const robot = action.type.split("/")[0];
  const answers = Object.values(reach).filter((each) => each.robot_id === robot);
  let worst: ActionReach | null = null;
  for (const goal of goalsOf(action)) {
    let best: ActionReach | null = null;
    for (const { items } of answers) {
      const item = items.find((each) => each.id === goal);
      if (item && (!best || worse(best.reach, item.reach)))
        best = { reach: item.reach, reason: item.reason ?? "", goal };
    }
    if (best && (!worst || worse(best.reach, worst.reach))) worst = best;
  }
  return worst;
}
