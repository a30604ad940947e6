/** Asks which arms, end effectors, grippers and suction cups the robots have that came online. */

import { put } from "../store/records";
import type { Arm, State } from "../store/state";
import { store } from "../store/store";
import { call } from "./session";
import { robotsOf } from "./streams";

/** Robots that were asked. */
const asked = new Set<string>();

export function forgetArms(): void {
  asked.clear();
}

/** Called with each state. */
export function followArms(state: State): void {
  if (state.live.state !== "started" || state.connection.status !== "ready") {
    if (state.live.state === "stopped") asked.clear();
    return;
  }
  for (const id of robotsOf(state)) {
    const connection = state.live.objects[id]?.state;
    const there = connection === undefined || connection === "online" || connection === "back";
    if (!there) asked.delete(id);
    else if (!asked.has(id)) {
      asked.add(id);
      const several = state.types.robots[state.doc?.objects[id]?.type ?? ""]?.multi_arm ?? false;
      // Refused by a robot that is just being lost: it is asked again when it is back.
      askArms(id, several).then(
        (arms) =>
          store.setState((now) =>
            now.live.state === "started" ? { live: { ...now.live, arms: put(now.live.arms, id, arms) } } : {},
          ),
        () => {},
      );
    }
  }
}

async function askArms(robot_id: string, several: boolean): Promise<Arm[]> {
  const ids = several ? await call("GetRobotArms", { robot_id }) : [""];
  return Promise.all(
    ids.map(async (id) => {
      const of = id ? { robot_id, arm_id: id } : { robot_id };
      const none = () => [];
      const [effectors, grippers, suctions] = await Promise.all([
        call("GetEndEffectors", of),
        call("GetGrippers", of).catch(none),
        call("GetSuctions", of).catch(none),
      ]);
      return { id, effectors, grippers, suctions };
    }),
  );
}
