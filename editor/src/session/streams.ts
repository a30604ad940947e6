/** Subscribe to joints and end effector poses of the robots that are online, again after each reconnect. */

import type { State } from "../store/state";
import { call, serves } from "./connection";
import type { Follower } from "./follower";

/** Update rates, Hz, if the server supports them. The 3D view follows the joints; end effector poses are numbers. */
const RATE = { joints: 30, eef_pose: 10 } as const;

/** Return the ids of the robots of the open scene. */
export function robotsOf(state: State): string[] {
  if (!state.doc) return [];
  return Object.values(state.doc.objects)
    .filter((object) => object.type in state.types.robots)
    .map((object) => object.id);
}

export class RobotStreams implements Follower {
  /** Ids of the robots with a subscription. */
  private readonly subscribed = new Set<string>();

  reset(): void {
    this.subscribed.clear();
  }

  follow(state: State): void {
    if (state.live.state !== "started" || state.connection.status !== "ready") {
      if (state.live.state === "stopped") this.subscribed.clear();
      return;
    }
    for (const id of robotsOf(state)) {
      const connection = state.live.objects[id]?.state;
      const connected = connection === undefined || connection === "online" || connection === "back";
      if (!connected) this.subscribed.delete(id);
      else if (!this.subscribed.has(id)) {
        this.subscribed.add(id);
        void subscribe(id);
      }
    }
  }
}

async function subscribe(robot_id: string): Promise<void> {
  for (const what of ["joints", "eef_pose"] as const) {
    const asked = serves("StreamRobot")
      ? call("StreamRobot", { robot_id, what, rate: RATE[what] })
      : call("RegisterForRobotEvent", { robot_id, what, send: true });
    // The request is refused if the robot has disconnected or has no such data; stale poses are marked.
    await asked.catch(() => {});
  }
}
