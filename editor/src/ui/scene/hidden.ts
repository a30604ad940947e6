/** Objects that a user has hidden: neither drawn nor picked for them. */

import { keepView } from "../../commands/viewstate";
import type { State } from "../../store/state";
import { now } from "../../store/store";

const NOTHING: string[] = [];

export function asideOf(state: State): string[] {
  const kept = state.view.user.blocklist;
  return Array.isArray(kept) ? (kept as string[]) : NOTHING;
}

export function putAside(id: string, on: boolean): void {
  const rest = asideOf(now()).filter((each) => each !== id);
  keepView("user", { blocklist: on ? [...rest, id] : rest });
}
