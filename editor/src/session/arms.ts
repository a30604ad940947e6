/** Request the arms, end effectors, grippers and suction cups of robots that come online. */

import { put } from "../store/records";
import type { Arm, State } from "../store/state";
import { store } from "../store/store";
import { call } from "./connection";
import type { Follower } from "./follower";
import { robotsOf } from "./streams";

export class RobotArms implements Follower {
  /** Ids of the robots whose arms were requested. */
  private readonly requested = new Set<string>();

  reset(): void {
    this.requested.clear();
  }

  follow(state: State): void {
    if (state.live.state !== "started" || state.connection.status !== "ready") {
      if (state.live.state === "stopped") this.requested.clear();
      return;
    }
    for (const id of robotsOf(state)) {
      const connection = state.live.objects[id]?.state;
      const connected = connection === undefined || connection === "online" || connection === "back";
      if (!connected) this.requested.delete(id);
      else if (!this.requested.has(id)) {
        this.requested.add(id);
        const several = state.types.robots[state.doc?.objects[id]?.type ?? ""]?.multi_arm ?? false;
        // The server refuses it if the robot has disconnected. It is repeated when the robot is connected again.
        loadArms(id, several).then(
          (arms) =>
            store.setState((now) =>
              now.live.state === "started" ? { live: { ...now.live, arms: put(now.live.arms, id, arms) } } : {},
            ),
          () => {},
        );
      }
    }
  }
}

async function loadArms(robot_id: string, several: boolean): Promise<Arm[]> {
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
