/** Asking somebody for what he holds, and being told when others ask, or when it is free. */

import { t } from "@lingui/core/macro";
import { handOver, keyOf } from "../store/handover";
import { now, store, tell } from "../store/store";
import { nameOf } from "../viewmodel/names";
import { keepView } from "./viewstate";

export function askFor(id: string): void {
  keepView("shared", { [keyOf(id)]: { by: now().connection.user, at: Date.now() } });
}

export function noLongerAsk(id: string): void {
  keepView("shared", { [keyOf(id)]: null });
}

/** Tell the user of wishes from now on; gives what ends that. */
export function followWishes(): () => void {
  return store.subscribe((state, before) => {
    const { wanted, free } = handOver(state, before);
    for (const { id, by } of wanted)
      tell("warn", t`${by} asks for ${nameOf(state, id)}, which you are using. Finish your change to release it.`);
    for (const id of free) {
      tell("info", t`${nameOf(state, id)} is free now.`);
      noLongerAsk(id);
    }
  });
}
