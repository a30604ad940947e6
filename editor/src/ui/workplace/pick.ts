/** Handle a pick in the view: end a connection in progress, or select. */

import { getState, select, setUi } from "../../store/store";
import { selectionOf } from "../../viewmodel/names";

/** `ids` are the candidates, most likely first. Picking the selected item again selects the one behind it. */
export function pick(ids: readonly string[]): void {
  const state = getState();
  const found = ids.map((id) => selectionOf(state, id)).filter((each) => each !== null);
  if (state.ui.connecting) {
    const target = found.find(({ kind }) => kind === "action" || kind === "terminal");
    if (target) void import("../../commands/program").then(({ finishConnecting }) => finishConnecting(target.id));
    return;
  }
  if (state.ui.picked) {
    const action = found.find(({ kind }) => kind === "action");
    if (action) void import("../../commands/functions").then(({ pickAction }) => pickAction(action.id));
    return;
  }
  // Picking again selects the next candidate, so that every item can be selected.
  const at = found.findIndex((each) => each.id === state.ui.selection?.id);
  const next = found[(at + 1) % Math.max(1, found.length)] ?? null;
  select(next);
  if (next) setUi({ tool: "" });
}
