/** The favorites of the user, stored on the server. */

import { memoized } from "../../store/memo";
import type { State } from "../../store/state";

const setOf = memoized((stored: unknown): ReadonlySet<string> => new Set(Array.isArray(stored) ? stored : []));

/** Return the ids of the favorites; the same set while they do not change. */
export function favoritesOf(state: State): ReadonlySet<string> {
  return setOf(state.view.general.stars);
}
