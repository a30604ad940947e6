/** Request an item that another user has locked, and notify users about requests and released items. */

import { t } from "@lingui/core/macro";
import { handOver, requestKey } from "../store/handover";
import { getState, notify, store } from "../store/store";
import { nameOf } from "../viewmodel/names";
import { storeViewState } from "./viewstate";

export function requestItem(id: string): void {
  storeViewState("shared", { [requestKey(id)]: { by: getState().connection.user, at: Date.now() } });
}

export function withdrawRequest(id: string): void {
  storeViewState("shared", { [requestKey(id)]: null });
}

/** Notify the user of requests from now on. Return a function that stops it. */
export function followItemRequests(): () => void {
  return store.subscribe((state, before) => {
    const { wanted, free } = handOver(state, before);
    for (const { id, by } of wanted)
      notify("warn", t`${by} asks for ${nameOf(state, id)}, which you are using. Finish your change to release it.`);
    for (const id of free) {
      notify("info", t`${nameOf(state, id)} is free now.`);
      withdrawRequest(id);
    }
  });
}
