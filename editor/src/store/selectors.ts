/** Questions that several places ask of the state. */

import type { PackageStateEnum } from "../protocol/types";
import type { State } from "./state";

/** States in which a program has the devices. */
export const RUNNING: ReadonlySet<PackageStateEnum> = new Set([
  "started",
  "running",
  "stopping",
  "pausing",
  "paused",
  "resuming",
]);

export const isRunning = (state: State): boolean => RUNNING.has(state.program.state);
/** Whether something may move at the program's or a user's command: the scene is online, or a program runs. */
export const isLive = (state: State): boolean =>
  state.live.state === "started" || state.live.state === "stopping" || isRunning(state);
export const isConnected = (state: State): boolean => state.connection.status === "ready";
export const isOnline = (state: State): boolean => state.live.state === "started";

/** Id of the document that is open: the project's, or the scene's. */
export const openId = (state: State): string => state.doc?.project?.id ?? state.doc?.scene.id ?? "";

/** Who else holds a thing; empty when nobody does, or the user himself. */
export function heldBy(state: State, id: string): string {
  const owner = state.locks[id];
  return owner && owner !== state.connection.user ? owner : "";
}

/** Whether a type is, or comes from, another. */
export function derivesFrom(state: State, type: string, base: string): boolean {
  for (let name: string | undefined = type, left = 20; name && left > 0; left--) {
    if (name === base) return true;
    name = state.types.byName[name]?.base;
  }
  return false;
}
