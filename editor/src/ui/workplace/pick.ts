/** What a pick in the view does: it says where a step leads while one is drawn, else it selects. */

import { now, select, setUi } from "../../store/store";
import { selectionOf } from "../../viewmodel/names";

/** `ids` are what was meant, the likeliest first. A pick of what is selected goes to what is behind it. */
export function pick(ids: readonly string[]): void {
  const state = now();
  const found = ids.map((id) => selectionOf(state, id)).filter((each) => each !== null);
  if (state.ui.connecting) {
    const target = found.find(({ kind }) => kind === "action" || kind === "terminal");
    if (target) void import("../../commands/program").then(({ endStep }) => endStep(target.id));
    return;
  }
  // So everything can be reached.
  const at = found.findIndex((each) => each.id === state.ui.selection?.id);
  const next = found[(at + 1) % Math.max(1, found.length)] ?? null;
  select(next);
  if (next) setUi({ tool: "" });
}
