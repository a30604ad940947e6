/** Functions of the open project: create, open, change, export and import them. */

import { t } from "@lingui/core/macro";
import { functionNames, picked, suggestedName } from "../program/functions";
import { freeName } from "../program/naming";
import { initialValue } from "../program/values";
import type { FunctionExport, Parameter } from "../protocol/types";
import { call } from "../session/connection";
import { scopeOf } from "../store/scope";
import { getState, notify, select, setUi, showFunction } from "../store/store";
import { saveAs } from "./files";
import { awaited } from "./ownEvents";
import { ask, refusal, sentence, whyNot } from "./requests";

// ------------------------------------------------------------------------------------------------ selection
/** Select several actions from now on: each tap adds or removes one. */
export const startPicking = (ids: readonly string[] = []): void => {
  setUi({ picked: ids, connecting: null, tool: getState().ui.tool });
};

export const cancelPicking = (): void => setUi({ picked: null });

/** Add or remove an action, with those between. */
export function pickAction(id: string): void {
  const { doc, ui } = getState();
  if (doc && ui.picked && id in doc.actions) setUi({ picked: picked(doc, ui.picked, id) });
}

/** Return why the selected actions cannot become a function; an empty string if they can. */
export const whyNoFunction = (ids: readonly string[]): Promise<string> => {
  const { doc } = getState();
  if (!doc || ids.length === 0) return Promise.resolve(t`Tap the actions.`);
  return whyNot("MakeFunction", { name: suggestedName(doc, ids), action_ids: [...ids] });
};

/** Move actions into a new function, and select the call that takes their place. */
export async function makeFunction(name: string, ids: readonly string[]): Promise<void> {
  const made = await ask("MakeFunction", { name, action_ids: [...ids] });
  if (!made) return;
  const { action_id } = made.data;
  await awaited((state) => state.doc?.actions[action_id]).catch(() => null);
  setUi({ picked: null, tool: "" });
  select({ kind: "action", id: action_id });
}

/** Replace a call by the actions of its function. */
export async function dissolve(action_id: string): Promise<void> {
  const done = await ask("DissolveCall", { action_id });
  const id = done?.data.action_ids[0];
  if (id !== undefined) select({ kind: "action", id });
}

// ------------------------------------------------------------------------------------------------ navigation
/** Show a function; Back returns to what is shown now. */
export function openFunction(id: string): void {
  const path = getState().doc?.path ?? [];
  const known = path.indexOf(id);
  showFunction(known < 0 ? [...path, id] : path.slice(0, known + 1));
}

// ------------------------------------------------------------------------------------------------ functions
export async function addFunction(name: string): Promise<void> {
  const added = await ask("AddFunction", { name });
  if (!added) return;
  const { id } = added.data;
  await awaited((state) => state.doc?.functions[id]).catch(() => null);
  openFunction(id);
}

export const renameFunction = (function_id: string, new_name: string) =>
  ask("RenameFunction", { function_id, new_name });

export async function removeFunction(id: string): Promise<void> {
  const name = getState().doc?.functions[id]?.name ?? "";
  if (await ask("RemoveFunction", { id })) notify("info", t`Removed ${name}. Press Undo to restore.`);
}

/** Add a copy of a function, and open it. */
export async function duplicateFunction(id: string): Promise<void> {
  const found = await ask("ExportFunction", { id });
  if (!found) return;
  const copied = await ask("ImportFunction", { function: found.data });
  if (copied) await openAdded(copied.data.ids);
}

async function openAdded(ids: readonly string[]): Promise<void> {
  const id = ids.at(-1) ?? "";
  const added = await awaited((state) => state.doc?.functions[id]).catch(() => null);
  if (!added) return;
  showFunction([id]);
  notify("info", t`Added the function ${added.name}.`);
}

/** Save a function, with those that it calls, as a file on this device. */
export async function exportFunction(id: string): Promise<void> {
  const found = await ask("ExportFunction", { id });
  const name = getState().doc?.functions[id]?.name ?? "function";
  if (found) saveAs(new Blob([JSON.stringify(found.data, null, 2)], { type: "application/json" }), `${name}.json`);
}

/** A file that contains a function, and the names of its action points that the project lacks. */
export interface FunctionFile {
  content: FunctionExport;
  points: string[];
}

/** Read a file with a function. Reject with a sentence if it contains none. */
export async function readFunction(file: Blob): Promise<FunctionFile> {
  let content: FunctionExport;
  try {
    content = JSON.parse(await file.text()) as FunctionExport;
  } catch {
    throw new Error(t`The file does not contain a function.`);
  }
  if (!Array.isArray(content?.functions) || !Array.isArray(content.references))
    throw new Error(t`The file does not contain a function.`);
  const { doc } = getState();
  const names = new Set(Object.values(doc?.points ?? {}).map((each) => each.name));
  const lacking = content.references.flatMap(({ point_id, point }) =>
    point !== undefined && !(point_id !== undefined && doc && point_id in doc.points) && !names.has(point)
      ? [point]
      : [],
  );
  return { content, points: [...new Set(lacking)] };
}

/** Add the function of a file. `points`: points of the project by names in the file. Return why it was refused. */
export async function importFunction({ content }: FunctionFile, points: Record<string, string>): Promise<string> {
  try {
    const { ids } = await call("ImportFunction", { function: content, points });
    await openAdded(ids);
    return "";
  } catch (error) {
    return sentence(error);
  }
}

// ------------------------------------------------------------------------------------------------ parameters, results
/** Return a value for the present calls when a parameter of a type is added. */
function valueFor(name: string, type: string): Parameter | undefined {
  const { doc } = getState();
  const place =
    type === "pose"
      ? Object.keys(doc?.orientations ?? {})[0]
      : type === "joints"
        ? Object.keys(doc?.joints ?? {})[0]
        : type === "position"
          ? Object.keys(doc?.points ?? {})[0]
          : undefined;
  const value = place === undefined ? initialValue({ name, type, dynamic_value: false }) : JSON.stringify(place);
  return value === undefined ? undefined : { name, type, value };
}

/** Add a parameter to the open function. `value`: JSON for the present calls. Return why it was refused. */
export const addFunctionParameter = (name: string, type: string, value?: string): Promise<string> =>
  refusal(() =>
    call("AddFunctionParameter", {
      function_id: scopeOf(getState().doc ?? { path: [] }),
      name,
      type,
      value: value === undefined ? valueFor(name, type) : { name, type, value },
    }),
  );

/** Return a free name for a parameter of the open function. */
export function freeParameterName(base: string): string {
  const { doc } = getState();
  const open = doc?.functions[scopeOf(doc)];
  const stored = Object.values(open?.actions ?? {}).flatMap((each) => each.flows.flatMap((flow) => flow.outputs));
  return freeName(base, [...(open?.parameters.map((each) => each.name) ?? []), ...stored]);
}

/**
 * Rename a parameter of the open function or change its type. Return why it was refused.
 *
 * `json`: the value for the present calls, by default a usual one of the type.
 */
export const updateFunctionParameter = (
  name: string,
  change: { new_name?: string; type?: string },
  json?: string,
): Promise<string> =>
  refusal(() => {
    const { type } = change;
    const value =
      type === undefined ? undefined : json === undefined ? valueFor(name, type) : { name, type, value: json };
    const function_id = scopeOf(getState().doc ?? { path: [] });
    return call("UpdateFunctionParameter", { function_id, name, ...change, ...(value && { value }) });
  });

export const removeFunctionParameter = (name: string) =>
  ask("RemoveFunctionParameter", { function_id: scopeOf(getState().doc ?? { path: [] }), name });

export const addFunctionResult = (link: string) =>
  ask("AddFunctionResult", { function_id: scopeOf(getState().doc ?? { path: [] }), link });

export const removeFunctionResult = (index: number) =>
  ask("RemoveFunctionResult", { function_id: scopeOf(getState().doc ?? { path: [] }), index });

/** Return a free name for a function. */
export const freeFunctionName = (base: string): string => {
  const { doc } = getState();
  return freeName(base, doc ? functionNames(doc) : []);
};
