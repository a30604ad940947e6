/** Selectors used in several places. */

import type { PackageStateEnum } from "../protocol/types";
import type { State } from "./state";

/** States in which a program uses the devices. */
export const RUNNING: ReadonlySet<PackageStateEnum> = new Set([
  "started",
  "running",
  "stopping",
  "pausing",
  "paused",
  "resuming",
]);

export const isRunning = (state: State): boolean => RUNNING.has(state.program.state);
/** Return whether the document cannot be edited: from before a program starts until the server has opened it again. */
export const isClosed = (state: State): boolean => isRunning(state) || state.doc?.closed === true;
/** Return whether something may move: the scene is online, or a program is running. */
export const isLive = (state: State): boolean =>
  state.live.state === "started" || state.live.state === "stopping" || isRunning(state);
export const isConnected = (state: State): boolean => state.connection.status === "ready";
export const isOnline = (state: State): boolean => state.live.state === "started";

/** Return the id of the open document: of the project, or of the scene. */
export const openId = (state: State): string => state.doc?.project?.id ?? state.doc?.scene.id ?? "";

/** Return the other user who holds an item; an empty string if it is free or held by this user. */
export function heldBy(state: State, id: string): string {
  const owner = state.locks[id];
  return owner && owner !== state.connection.user ? owner : "";
}

/** Return whether a type is, or derives from, another. */
export function derivesFrom(state: State, type: string, base: string): boolean {
  for (let name: string | undefined = type, left = 20; name && left > 0; left--) {
    if (name === base) return true;
    name = state.types.byName[name]?.base;
  }
  return false;
}
