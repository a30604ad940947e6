/** What the server keeps of the lists: what a user has opened last, and what all take as a template. */

import { keepGeneral } from "../../commands/viewstate";
import { beyond, type Opened, openedOf } from "../../home/opened";
import type { State } from "../../store/state";
import { now } from "../../store/store";

let last: { kept: unknown; opened: Opened } = { kept: undefined, opened: [] };

/** Documents that the user has opened, the last first; the same list while it is the same. */
export function recentOf(state: State): Opened {
  const { general } = state.view;
  if (general !== last.kept) last = { kept: general, opened: openedOf(general) };
  return last.opened;
}

/** One key each, so that two tablets of one user take nothing from each other. */
export function keepRecent(id: string): void {
  const forgotten = beyond(recentOf(now()), id).map((each) => [`opened/${each}`, null] as const);
  keepGeneral({ ...Object.fromEntries(forgotten), [`opened/${id}`]: Date.now() });
}

const key = (id: string) => `template/${id}`;
export const isTemplate = (state: State, id: string): boolean => state.view.general[key(id)] === true;
export const keepTemplate = (id: string, on: boolean): void => keepGeneral({ [key(id)]: on || null }, "shared");
