/** What a user has marked for himself, on whichever tablet. */

import type { State } from "../../store/state";

let last: { kept: unknown; stars: ReadonlySet<string> } = { kept: undefined, stars: new Set() };

/** The same set while it is the same. */
export function starsOf(state: State): ReadonlySet<string> {
  const kept = state.view.general.stars;
  if (kept !== last.kept) last = { kept, stars: new Set(Array.isArray(kept) ? (kept as string[]) : []) };
  return last.stars;
}
