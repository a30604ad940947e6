/** Objects that a user has hidden: neither drawn nor picked for them. */

import { storeViewState } from "../../commands/viewstate";
import type { State } from "../../store/state";
import { getState } from "../../store/store";

const NOTHING: readonly string[] = [];

export function hiddenOf(state: State): readonly string[] {
  const stored = state.view.user.blocklist;
  return Array.isArray(stored) ? (stored as string[]) : NOTHING;
}

export function setHidden(id: string, on: boolean): void {
  const rest = hiddenOf(getState()).filter((each) => each !== id);
  storeViewState("user", { blocklist: on ? [...rest, id] : rest });
}
