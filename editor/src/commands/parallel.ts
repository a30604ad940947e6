/** Parallel work of the open project: make it, and change its branches. */

import { t } from "@lingui/core/macro";
import type { Slot } from "../program/chain";
import { MAX_BRANCHES, MIN_BRANCHES, whyNotAtOnce } from "../program/lanes";
import { calledBy, callMeta } from "../program/logic";
import { actionNames, freeName } from "../program/naming";
import { callsIn } from "../program/parallel";
import type { CallOptions } from "../protocol/client";
import { call } from "../session/connection";
import { getState, notify, select, setUi } from "../store/store";
import { awaited } from "./ownEvents";
import { addLoose, insert } from "./program";
import { ask, newStep, sentence, whyNot } from "./requests";

/** Return a free name for parallel work. */
export const parallelName = (): string => {
  const { doc } = getState();
  return doc ? freeName("in_parallel", actionNames(doc)) : "";
};

/** Return why the selected actions cannot run at once; an empty string if they can. */
export async function whyNotParallel(ids: readonly string[]): Promise<string> {
  const { doc } = getState();
  if (!doc || ids.length < MIN_BRANCHES || ids.length > MAX_BRANCHES) return t`Select two to four calls of functions.`;
  const calls = callsIn(doc, { branches: [...ids] });
  const other = calls.find((each) => !calledBy(doc, each));
  if (other) return t`${other.name} does not call a function. Make a function of it first.`;
  const refused = await whyNot("MakeParallel", { name: parallelName(), action_ids: [...ids] });
  return refused || whyNotAtOnce(doc, calls);
}

/** Let calls run at once, and select the action that runs them. */
export async function makeParallel(name: string, ids: readonly string[]): Promise<void> {
  const made = await ask("MakeParallel", { name, action_ids: [...ids] });
  if (!made) return;
  await awaited((state) => state.doc?.actions[made.data.action_id]).catch(() => null);
  setUi({ picked: null, tool: "" });
  select({ kind: "action", id: made.data.action_id });
}

/** Add an action that runs calls of functions at once, in a slot of the program, as one step of undo. */
export async function addParallel(name: string, functions: readonly string[], slot: Slot | null): Promise<void> {
  const step = newStep();
  try {
    const action_ids: string[] = [];
    for (const id of functions) action_ids.push(await newCall(id, slot, step));
    const { action_id } = await call("MakeParallel", { name, action_ids }, step);
    await awaited((state) => state.doc?.actions[action_id]);
    if (slot) await insert(action_id, slot, step);
    setUi({ tool: "" });
    select({ kind: "action", id: action_id });
  } catch (error) {
    notify("error", sentence(error));
  }
}

/** Add a call of a function without connections. Return its id. */
function newCall(functionId: string, slot: Slot | null, step: CallOptions, pointId?: string): Promise<string> {
  const { doc, types } = getState();
  const called = doc?.functions[functionId];
  if (!doc || !called) throw new Error(t`The function no longer exists.`);
  return addLoose(functionId, callMeta(types, doc, called), pointId === undefined ? null : { pointId }, slot, step);
}

/** Add a call of a function as another branch. */
export async function addBranch(action_id: string, functionId: string): Promise<void> {
  const action = getState().doc?.actions[action_id];
  if (!action?.branches) return;
  const step = newStep();
  try {
    const added = await newCall(functionId, null, step, action.pointId || undefined);
    await call("UpdateParallel", { action_id, branches: [...action.branches, added] }, step);
  } catch (error) {
    notify("error", sentence(error));
  }
}

/** Remove a branch with its call. The branch is kept if its results are used. */
export async function removeBranch(action_id: string, id: string): Promise<void> {
  const { doc } = getState();
  const action = doc?.actions[action_id];
  const name = doc?.actions[id]?.name ?? "";
  if (!action?.branches) return;
  const step = newStep();
  const branches = action.branches.filter((each) => each !== id);
  if (!(await ask("UpdateParallel", { action_id, branches }, step))) return;
  if (await ask("RemoveAction", { id }, step)) notify("info", t`Removed ${name}. Press Undo to restore.`);
  else await ask("UpdateParallel", { action_id, branches: action.branches }, step);
}

/** Let the calls run one after the other, and select the first one. */
export async function dissolveParallel(action_id: string): Promise<void> {
  const first = getState().doc?.actions[action_id]?.branches?.[0];
  if ((await ask("DissolveParallel", { action_id })) && first !== undefined) select({ kind: "action", id: first });
}
