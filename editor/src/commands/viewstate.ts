/** View state stored on the server: settings of a user for all devices, and the shared view state of a document. */

import type { ViewScope } from "../protocol/types";
import { call, serves } from "../session/connection";
import { openId } from "../store/selectors";
import { getState, store } from "../store/store";

/** Store values of the open document by their keys; null removes one. They take effect at once. */
export function storeViewState(scope: ViewScope, values: Record<string, unknown>): void {
  store.setState((state) => {
    const stored = { ...state.view[scope], ...values };
    for (const [key, value] of Object.entries(values)) if (value === null) delete stored[key];
    return { view: { ...state.view, [scope]: stored } };
  });
  if (!serves("SetViewState")) return;
  // Lost with the connection: after the reconnect the server sends the old values.
  call("SetViewState", { scope, document: openId(getState()), values }).catch(() => {});
}

/** Store values that belong to no document, by their keys: of the user, such as favorites, or of all users. */
export function storeGeneralState(values: Record<string, unknown>, scope: ViewScope = "user"): void {
  store.setState((state) => {
    const stored = { ...state.view.general, ...values };
    for (const [key, value] of Object.entries(values)) if (value === null) delete stored[key];
    return { view: { ...state.view, general: stored } };
  });
  if (!serves("SetViewState")) return;
  call("SetViewState", { scope, values }).catch(() => {}); // as above
}
