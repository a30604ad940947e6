/** View state stored on the server: settings of a user for all devices, and the shared view state of a document. */

import type { ViewScope } from "../protocol/types";
import { call, serves } from "../session/connection";
import { openId } from "../store/selectors";
import { now, store } from "../store/store";

/** Store values of the open document by their keys; null removes one. They take effect at once. */
export function keepView(scope: ViewScope, values: Record<string, unknown>): void {
  store.setState((state) => {
    const kept = { ...state.view[scope], ...values };
    for (const [key, value] of Object.entries(values)) if (value === null) delete kept[key];
    return { view: { ...state.view, [scope]: kept } };
  });
  if (!serves("SetViewState")) return;
  // Lost with the connection: after the reconnect the server sends the old values.
  call("SetViewState", { scope, document: openId(now()), values }).catch(() => {});
}

/** Store values that belong to no document, by their keys: of the user, such as favorites, or of all users. */
export function keepGeneral(values: Record<string, unknown>, scope: ViewScope = "user"): void {
  store.setState((state) => {
    const kept = { ...state.view.general, ...values };
    for (const [key, value] of Object.entries(values)) if (value === null) delete kept[key];
    return { view: { ...state.view, general: kept } };
  });
  if (!serves("SetViewState")) return;
  call("SetViewState", { scope, values }).catch(() => {}); // as above
}
