/** The program: actions, their parameters, and connections. */

import { t } from "@lingui/core/macro";
import { insertion, type Slot } from "../program/chain";
import { fieldsOf } from "../program/comparisons";
import { calledBy, cannotLead, END, freeStep, incoming, outgoing, placeKey } from "../program/logic";
import { actionNames, freeName, newOutputs, resultNames } from "../program/naming";
import type { CallOptions } from "../protocol/client";
import type {
  Action,
  ActionParameter,
  LogicWhen,
  ObjectAction,
  Position,
  ProjectLogicIf,
  Requests,
  Retry,
} from "../protocol/types";
import { call } from "../session/connection";
import { whyUnavailable } from "../store/permissions";
import { scopeOf } from "../store/scope";
import { isClosed } from "../store/selectors";
import type { State } from "../store/state";
import { getState, notify, select, setUi, store } from "../store/store";
import { addErrorExit } from "./errorExits";
import { awaited } from "./ownEvents";
import { ask, newStep, refusal, sentence, withLock } from "./requests";
import { startingParameters, type Where } from "./startingValues";

/** Return why a request cannot edit the program now; an empty string if it can. */
export function notEditable(state: State, request: keyof Requests = "UpdateAction"): string {
  if (!state.doc?.project) return t`Open a project first. A scene has no program.`;
  return whyUnavailable(state, request) || (isClosed(state) ? t`Stop the program first.` : "");
}

/**
 * Add an action with names for its results, and the point and orientation that it needs, and connect it in a slot of
 * the program, as one step of undo. Return its id, or undefined after notifying the user.
 *
 * `object`: the device, or the name of a service type, whose object is added if there is none. `where`: null if the
 * action needs no place; it is then stored with its predecessor.
 */
export async function addAction(
  object: string,
  meta: ObjectAction,
  where: Where | null,
  slot: Slot | null,
): Promise<string | undefined> {
  try {
    const step = newStep();
    const id = await addLoose(await serviceObject(object, step), meta, where, slot, step);
    if (slot) await insert(id, slot, step);
    select({ kind: "action", id });
    return id;
  } catch (error) {
    notify("error", sentence(error));
    return undefined;
  }
}

/** Add an action of a device or function, with what it needs, but without connections. Return its id. */
export async function addLoose(
  objectId: string,
  meta: ObjectAction,
  where: Where | null,
  slot: Slot | null,
  step: CallOptions,
): Promise<string> {
  const called = getState().doc?.functions[objectId];
  const base = called?.name ?? meta.name;
  const inFunction = (getState().doc?.path.length ?? 0) > 0; // its actions need no point
  const at = where ?? (inFunction ? { pointId: "" } : await anyPlace(objectId, slot, step));
  const pointId = "pointId" in at ? at.pointId : await newPoint(`${base}_point`, at.position, step);
  const parameters = await startingParameters(objectId, meta, pointId, at, step);
  const { doc } = getState();
  if (!doc) throw new Error(t`Open a project first. A scene has no program.`);
  const name = freeName(base, actionNames(doc));
  const outputs = called ? resultNames(doc, called) : newOutputs(doc, base, meta.returns.length);
  const flows = [{ type: "default" as const, outputs }];
  const action_point_id = scopeOf(doc) || pointId;
  await call("AddAction", { action_point_id, name, type: `${objectId}/${meta.name}`, parameters, flows }, step);
  return (await awaited((state) => Object.values(state.doc?.actions ?? {}).find((each) => each.name === name))).id;
}

/** Return the id of an object; for the name of a type, that of its first object, which is added if there is none. */
async function serviceObject(object: string, step: CallOptions): Promise<string> {
  const of = (state: State) => Object.values(state.doc?.objects ?? {}).find((each) => each.type === object)?.id;
  const { doc } = getState();
  if (doc && (object in doc.objects || object in doc.functions)) return object;
  const known = of(getState());
  if (known !== undefined) return known;
  const name = freeName(
    object.replace(/Actions$/, "").toLowerCase(),
    Object.values(doc?.objects ?? {}).map((each) => each.name),
  );
  // Undo cannot remove an object while the scene is online, and would refuse the whole step.
  await call("AddSceneObject", { name, type: object }, getState().live.state === "stopped" ? step : {});
  return awaited(of);
}

/** Return the point for an action without a place: that of its predecessor, or one on the device or in the world. */
async function anyPlace(objectId: string, slot: Slot | null, step: CallOptions): Promise<Where> {
  const { doc } = getState();
  const before = doc?.actions[slot?.after ?? ""]?.pointId ?? Object.keys(doc?.points ?? {})[0];
  if (before !== undefined) return { pointId: before };
  const position = doc?.objects[objectId]?.pose?.position ?? { x: 0, y: 0, z: 0 };
  return { pointId: await newPoint("program", position, step) };
}

/** Connect a new action in a slot, before the actions that were there. */
export async function insert(id: string, slot: Slot, step: CallOptions): Promise<void> {
  const { doc } = getState();
  if (!doc) return;
  const { redirect, branch, to } = insertion(doc, slot);
  const update = async (item: string, end: string, condition: ProjectLogicIf | undefined) => {
    const start = doc.logic[item]?.start;
    if (start) await call("UpdateLogicItem", { logic_item_id: item, start, end, condition }, step);
  };
  if (branch) await update(branch.id, doc.logic[branch.id]?.end ?? END, branch.condition);
  if (redirect)
    await update(redirect, id, slot.condition); // an error exit keeps its kinds
  else await call("AddLogicItem", { start: slot.after, end: id, condition: slot.condition }, step);
  await call("AddLogicItem", { start: id, end: to }, step);
}

async function newPoint(base: string, position: Position, step: CallOptions): Promise<string> {
  const taken = Object.values(getState().doc?.points ?? {}).map((each) => each.name);
  const name = freeName(base, taken);
  await call("AddActionPoint", { name, position }, step);
  return (await awaited((state) => Object.values(state.doc?.points ?? {}).find((each) => each.name === name))).id;
}

// ------------------------------------------------------------------------------------------------ actions

/** Change a parameter. Return why it was refused, for the form. */
export const setParameter = (actionId: string, parameter: ActionParameter): Promise<string> =>
  refusal(() =>
    withLock(actionId, () => {
      const action = getState().doc?.actions[actionId];
      if (!action) throw new Error(t`The action no longer exists.`);
      const rest = action.parameters.filter((each) => each.name !== parameter.name);
      return call("UpdateAction", { action_id: actionId, parameters: [...rest, parameter] });
    }),
  );

/** Name the results of an action. Return why it was refused. */
export const nameResults = (actionId: string, outputs: string[]): Promise<string> =>
  refusal(() =>
    withLock(actionId, () => call("UpdateAction", { action_id: actionId, flows: [{ type: "default", outputs }] })),
  );

/** Set the number of repetitions of a failed action; 0 removes the retry. Return the reason of a refusal. */
export const setRetry = (actionId: string, retry: Retry): Promise<string> =>
  refusal(() => withLock(actionId, () => call("UpdateAction", { action_id: actionId, retry })));

export const renameAction = (action_id: string, new_name: string): Promise<string> =>
  refusal(() => withLock(action_id, () => call("RenameAction", { action_id, new_name })));

/** Add a copy of an action at the same point, with its retry, its own results, and without connections. */
export async function duplicateAction(action: Action & { pointId: string }): Promise<void> {
  const { doc } = getState();
  if (!doc) return;
  const name = freeName(action.name, actionNames(doc));
  const count = action.flows[0]?.outputs.length ?? 0;
  const called = calledBy(doc, action);
  const outputs = newOutputs(doc, called?.name ?? action.type.split("/")[1] ?? action.name, count);
  const flows = [{ type: "default" as const, outputs }];
  if (
    !(await ask("AddAction", {
      action_point_id: scopeOf(doc) || action.pointId,
      name,
      type: action.type,
      parameters: action.parameters,
      flows,
      retry: action.retry,
    }))
  )
    return;
  const added = await awaited((state) =>
    Object.values(state.doc?.actions ?? {}).find((each) => each.name === name),
  ).catch(() => null);
  if (added) select({ kind: "action", id: added.id });
}

/** Remove an action and its connections by one edit. If it has one next step, its predecessors continue there. */
export async function removeAction(id: string): Promise<void> {
  const { doc } = getState();
  const name = doc?.actions[id]?.name;
  if (!doc || name === undefined) return;
  const steps = outgoing(doc, id).length + incoming(doc, id).length;
  if (await ask("RemoveAction", { id, with_steps: true }))
    notify(
      "info",
      steps > 0
        ? t`Removed ${name} with its steps. Press Undo to restore.`
        : t`Removed ${name}. Press Undo to restore.`,
    );
}

// ------------------------------------------------------------------------------------------------ connections

/** Start a connection: the next tap on an action selects its target. */
export function startConnecting(from: string, condition?: ProjectLogicIf, item?: string, error = false): void {
  setUi({ connecting: { from, condition, item, error } });
}

export const cancelConnecting = (): void => setUi({ connecting: null });

/** Finish the connection at an item. */
export async function finishConnecting(to: string): Promise<void> {
  const { connecting } = getState().ui;
  if (!connecting) return;
  cancelConnecting();
  const { from, condition, item, error } = connecting;
  if (item !== undefined) {
    const step = getState().doc?.logic[item];
    if (step && (await updateStep(item, step.start, to, step.condition))) select({ kind: "logic", id: item });
  } else if (error) await addErrorExit(from, to);
  else await connect(from, to, condition);
}

/** Connect `to` after `from`, under a free condition unless one is given. Notify the user if it is impossible. */
export async function connect(from: string, to: string, condition?: ProjectLogicIf): Promise<void> {
  const { doc, types } = getState();
  if (!doc) return;
  const why = cannotLead(doc, from, to);
  if (why) return notify("info", why);
  const step = newStep();
  let given = condition;
  if (!given) {
    const free = freeStep(doc, types, from);
    if (typeof free === "string") return notify("info", free);
    given = free.condition;
    if (
      free.first &&
      !(await updateStep(free.first.item.id, free.first.item.start, free.first.item.end, free.first.condition, step))
    )
      return;
  }
  if (!(await ask("AddLogicItem", { start: from, end: to, condition: given }, step))) return;
  const added = await awaited((state) =>
    Object.values(state.doc?.logic ?? {}).find((each) => each.start === from && each.end === to),
  ).catch(() => null);
  if (added) select({ kind: "logic", id: added.id });
}

export const updateStep = (
  logic_item_id: string,
  start: string,
  end: string,
  condition: ProjectLogicIf | undefined,
  options?: CallOptions,
) => ask("UpdateLogicItem", { logic_item_id, start, end, condition }, options);

/** Like `updateStep`, for a form. */
export const setCondition = (id: string, when: LogicWhen): Promise<string> =>
  refusal(() => {
    const { doc, types } = getState();
    const step = doc?.logic[id];
    if (!step) throw new Error(t`The connection no longer exists.`);
    return call("UpdateLogicItem", {
      logic_item_id: id,
      start: step.start,
      end: step.end,
      ...fieldsOf(doc, types, when),
    });
  });

export const removeStep = (logic_item_id: string) => ask("RemoveLogicItem", { logic_item_id });

/** Show the puck of an action, START or END at a position, on this page only; undefined: at its own position. */
export function showPuck(id: string, position: unknown): void {
  const key = placeKey(getState().doc, id);
  store.setState(({ view }) => {
    const { [key]: _, ...rest } = view.shared;
    return { view: { ...view, shared: position ? { ...rest, [key]: position } : rest } };
  });
}

/** Move the puck of an action, START or END, for all users; null: back to its own position. */
export async function placePuck(id: string, position: Position | null): Promise<void> {
  const document = getState().doc?.project?.id ?? "";
  const key = placeKey(getState().doc, id);
  const before = getState().view.shared[key];
  // The server sends changes of the view state to everybody except the user who made them.
  showPuck(id, position);
  if (!(await ask("SetViewState", { scope: "shared", document, values: { [key]: position } }))) showPuck(id, before);
}
