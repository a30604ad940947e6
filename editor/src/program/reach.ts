/** Whether the robot of an action gets where the action is told to go. Pure. */

import type { Action, Reach, ReachabilityData } from "../protocol/types";
import { decoded } from "./values";

/** From the best to the worst. */
export const REACHES: readonly Reach[] = ["reachable", "near_limit", "unknown", "in_collision", "out_of_reach"];

export const worse = (a: Reach, b: Reach): boolean => REACHES.indexOf(a) > REACHES.indexOf(b);

export interface ActionReach {
  reach: Reach;
  /** Why not, as the server says it; empty where it gets there. */
  reason: string;
  /** The orientation or joints that are the worst of what it is told. */
  goal: string;
}

/** Orientations and joints that an action is told to go to. */
export function goalsOf({ parameters }: Pick<Action, "parameters">): string[] {
  return parameters.flatMap(({ type, value }) =>
    type === "pose" || type === "joints" ? [String(decoded(value))] : [],
  );
}

/**
 * How the robot of an action gets to all that the action is told to go to: of each goal the answer of the end effector
 * that gets there best, of all goals the worst. Null where nothing is known, or it goes nowhere.
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
