/** Move an action within a straight sequence of the program. */

import { moveOf } from "../program/moving";
import { getState, notify } from "../store/store";
import { notEditable, updateStep } from "./program";
import { ask, newStep } from "./requests";

/** Move an action to a place in its run, as one step of undo. Notify the user if it is impossible. */
export async function moveAction(id: string, to: number): Promise<void> {
  const { doc } = getState();
  if (!doc) return;
  const why = notEditable(getState(), "UpdateLogicItem");
  const move = why || moveOf(doc, id, to);
  if (typeof move === "string") return notify("info", move);
  const step = newStep();
  if (!(await ask("RemoveLogicItem", { logic_item_id: move.remove }, step))) return;
  for (const { id: item, end } of move.redirect) {
    const known = doc.logic[item];
    if (known && !(await updateStep(item, known.start, end, known.condition, step))) return;
  }
  await ask("AddLogicItem", move.add, step);
}
