/** Asks for joints and end effectors of the robots that are online, again after each reconnect and return. */

import type { State } from "../store/state";
import { call, serves } from "./session";

/** Hz at which joints are asked for where the server can; end effectors are only read out. */
const RATE = { joints: 30, eef_pose: 10 } as const;

/** Robots whose streams were asked for. */
const streamed = new Set<string>();

export function forgetStreams(): void {
  streamed.clear();
}

/** Ids of the robots of the open scene. */
export function robotsOf(state: State): string[] {
  if (!state.doc) return [];
  return Object.values(state.doc.objects)
    .filter((object) => object.type in state.types.robots)
    .map((object) => object.id);
}

/** Called with each state: asks for the streams of robots that came online. */
export function followRobots(state: State): void {
  if (state.live.state !== "started" || state.connection.status !== "ready") {
    if (state.live.state === "stopped") streamed.clear();
    return;
  }
  for (const id of robotsOf(state)) {
    const connection = state.live.objects[id]?.state;
    const there = connection === undefined || connection === "online" || connection === "back";
    if (!there) streamed.delete(id);
    else if (!streamed.has(id)) {
      streamed.add(id);
      void stream(id);
    }
  }
}

async function stream(robot_id: string): Promise<void> {
  for (const what of ["joints", "eef_pose"] as const) {
    const asked = serves("StreamRobot")
      ? call("StreamRobot", { robot_id, what, rate: RATE[what] })
      : call("RegisterForRobotEvent", { robot_id, what, send: true });
    // Refused by a robot that is just being lost, or has none: what is stale is shown as such.
    await asked.catch(() => {});
  }
}
