/** The permissions of the user, derived from the state alone. */

import { t } from "@lingui/core/macro";
import { MIN_ROLE, type Requests } from "../protocol/types";
import type { State } from "./state";

/** Return why the user cannot send a request now; an empty string if they can. */
export function whyUnavailable(state: State, request: keyof Requests): string {
  if (state.connection.status !== "ready") return t`Not connected to the server.`;
  if (state.connection.role < MIN_ROLE[request]) return t`Your role does not allow this.`;
  return "";
}
