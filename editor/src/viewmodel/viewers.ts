/** Other users who see the open document in AR. */

import type { Pose } from "../protocol/types";
import { openId } from "../store/selectors";
import type { State } from "../store/state";

export interface Viewer {
  user: string;
  /** Pose of their camera in the workplace: x right, y down, z forward. */
  camera: Pose;
}

/** Return the users in AR whose camera is known. */
export function viewersOf(state: State): Viewer[] {
  return Object.values(state.users).flatMap(({ user, online, presence }) =>
    online && presence?.camera && user !== state.connection.user && presence.document === openId(state)
      ? [{ user, camera: presence.camera }]
      : [],
  );
}
