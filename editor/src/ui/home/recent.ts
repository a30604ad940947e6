/** Documents opened recently by the user, and templates shared by all users. Both are stored on the server. */

import { storeGeneralState } from "../../commands/viewstate";
import { idsToForget, type RecentIds, recentIds } from "../../home/opened";
import { memoized } from "../../store/memo";
import type { State } from "../../store/state";
import { getState } from "../../store/store";

const openedMemo = memoized(recentIds);

/** Return the documents that the user opened, newest first; the same list while it does not change. */
export function recentOf(state: State): RecentIds {
  return openedMemo(state.view.general);
}

/** Store that the user opened a document; each has its own key, so that two devices do not conflict. */
export function storeOpened(id: string): void {
  const forgotten = idsToForget(recentOf(getState()), id).map((each) => [`opened/${each}`, null] as const);
  storeGeneralState({ ...Object.fromEntries(forgotten), [`opened/${id}`]: Date.now() });
}

const key = (id: string) => `template/${id}`;
export const isTemplate = (state: State, id: string): boolean => state.view.general[key(id)] === true;
export const storeTemplate = (id: string, on: boolean): void => storeGeneralState({ [key(id)]: on || null }, "shared");
