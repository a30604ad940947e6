/** Return why this user cannot change an item of the open document now; an empty string if they can. */

import { t } from "@lingui/core/macro";
import type { Requests } from "../../protocol/types";
import { whyUnavailable } from "../../store/permissions";
import { heldBy, isClosed } from "../../store/selectors";
import type { State } from "../../store/state";
import { useEditor } from "../../store/store";

function whyNotNow(state: State, id: string, request: keyof Requests): string {
  if (isClosed(state)) return t`A program is running.`;
  const holder = heldBy(state, id);
  if (holder) return t`In use by ${holder}.`;
  return whyUnavailable(state, request);
}

export const useWhyNot = (id: string, request: keyof Requests): string =>
  useEditor((state) => whyNotNow(state, id, request));
