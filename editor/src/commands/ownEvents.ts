/** Wait for the events of own requests. */

import { t } from "@lingui/core/macro";
import type { State } from "../store/state";
import { getState, store } from "../store/store";

/** Time within which the event of a change arrives after the answer, s. */
const WITHIN = 5;

/** Wait until `find` finds something in the state, and return it. Reject if it does not within the time limit, s. */
export function awaited<T>(find: (state: State) => T | undefined, within = WITHIN): Promise<T> {
  return new Promise((resolve, reject) => {
    const known = find(getState());
    if (known !== undefined) return resolve(known);
    const timer = setTimeout(() => {
      stop();
      reject(new Error(t`The server did not confirm the change.`));
    }, within * 1000);
    const stop = store.subscribe((state) => {
      const found = find(state);
      if (found === undefined) return;
      clearTimeout(timer);
      stop();
      resolve(found);
    });
  });
}
