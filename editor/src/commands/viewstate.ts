/** What a user finds again on another tablet, and what all share of how the document is looked at: kept by the server. */

import type { ViewScope } from "../protocol/types";
import { call, serves } from "../session/connection";
import { openId } from "../store/selectors";
import { now, store } from "../store/store";

/** Keep values of the open document by their keys; null takes one away. Seen at once, told to the others by the server. */
export function keepView(scope: ViewScope, values: Record<string, unknown>): void {
  store.setState((state) => {
    const kept = { ...state.view[scope], ...values };
    for (const [key, value] of Object.entries(values)) if (value === null) delete kept[key];
    return { view: { ...state.view, [scope]: kept } };
  });
  if (!serves("SetViewState")) return;
  // Lost with the connection: then it is as it was, as told when it is back.
  call("SetViewState", { scope, document: openId(now()), values }).catch(() => {});
}

/** Keep values that belong to no document, by their keys: of the user, as stars and how he likes his tools, or of all. */
export function keepGeneral(values: Record<string, unknown>, scope: ViewScope = "user"): void {
  store.setState((state) => {
    const kept = { ...state.view.general, ...values };
    for (const [key, value] of Object.entries(values)) if (value === null) delete kept[key];
    return { view: { ...state.view, general: kept } };
  });
  if (!serves("SetViewState")) return;
  call("SetViewState", { scope, values }).catch(() => {}); // as above
}
