/** Objects that a user has hidden: neither drawn nor picked for them. */

import { storeViewState } from "../../commands/viewstate";
import type { State } from "../../store/state";
import { now } from "../../store/store";

const NOTHING: string[] = [];

export function asideOf(state: State): string[] {
  const stored = state.view.user.blocklist;
  return Array.isArray(stored) ? (stored as string[]) : NOTHING;
}

export function putAside(id: string, on: boolean): void {
  const rest = asideOf(now()).filter((each) => each !== id);
  storeViewState("user", { blocklist: on ? [...rest, id] : rest });
}
