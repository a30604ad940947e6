/** The scene in operation: online, offline, and the stop. */

import { Refused } from "../protocol/errors";
import { ask, sentence } from "./asking";
import { endHolds } from "./holds";
import { call, serves } from "../session/session";
import { robotsOf } from "../session/streams";
import type { State } from "../store/state";
import { now, tell } from "../store/store";

/** Go online; devices that fail are left out where the server can do without them. */
export const goOnline = () => ask(serves("StartSceneKeepGoing") ? "StartSceneKeepGoing" : "StartScene");
export const goOffline = () => ask("StopScene");
export const retryObject = (object_id: string) => ask("RetryObject", { object_id }, { deadline: 60 });

/**
 * Stop what moves: the program if one runs, every robot that can be stopped, and the action that is being tried. All at
 * once, none waiting for another. This is a functional stop, and no safety function.
 */
export async function stopMotion(): Promise<void> {
  const state = now();
  const stops: Promise<unknown>[] = [];
  const { state: program } = state.program;
  if (program === "running" || program === "resuming" || program === "pausing" || program === "paused") {
    stops.push(call("StopPackage"));
  }
  if (state.live.state === "started") {
    for (const robot_id of robotsOf(state)) {
      const type = state.doc?.objects[robot_id]?.type ?? "";
      if (state.types.robots[type]?.features.stop) stops.push(call("StopRobot", { robot_id }));
    }
    if (state.live.executing) stops.push(call("CancelAction"));
  }
  endHolds();
  const ended = await Promise.allSettled(stops);
  const failed = ended.filter((each) => each.status === "rejected");
  // A robot that stands is refused its stop: that is no failure. All else is.
  if (failed.some((each) => !(each.reason instanceof Refused)) || (failed.length === stops.length && isMoving(state))) {
    tell("error", `Not stopped: ${failed.map((each) => sentence(each.reason)).join(" ")} Use the emergency stop.`);
  }
}

function isMoving(state: State): boolean {
  return Object.keys(state.live.moving).length > 0 || Object.keys(state.live.holds).length > 0;
}
