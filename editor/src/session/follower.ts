/** Part of the session that requests data when the state asks for it. */

import type { State } from "../store/state";

export interface Follower {
  /** Called with each new state. */
  follow(state: State): void;
  /** Forget what was requested, since the connection is a new one. */
  reset(): void;
}
