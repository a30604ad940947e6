/** Which part of the project the views show: the program, or one of its functions. Pure functions. */

import type { Action, ProjectFunction } from "../protocol/types";
import { byId } from "./records";
import type { OpenDocument, OpenFunction } from "./state";

/** Return the id of the open function; an empty string while the program is shown. */
export const scopeOf = (doc: Pick<OpenDocument, "path">): string => doc.path.at(-1) ?? "";

export function functionOf({ actions, logic, ...bare }: ProjectFunction): OpenFunction {
  return { ...bare, actions: byId(actions.map((each) => ({ ...each, pointId: "" }))), logic: byId(logic) };
}

/** Return the document with functions open, as far as they exist; without any, the program is open. */
export function inScope(doc: OpenDocument, path: readonly string[]): OpenDocument {
  const missing = path.findIndex((id) => !(id in doc.functions));
  const open = missing < 0 ? path : path.slice(0, missing);
  const opened = doc.functions[open.at(-1) ?? ""];
  if (!opened) return doc.path.length === 0 ? doc : { ...doc, ...doc.program, path: [] };
  const actions = placed(doc, opened);
  const same = actions === opened.actions;
  const functions = same ? doc.functions : { ...doc.functions, [opened.id]: { ...opened, actions } };
  return { ...doc, functions, actions, logic: opened.logic, path: open };
}

/** Return the path to the program ([]) or function that contains an action or connection; undefined if none does. */
export function pathTo(doc: OpenDocument, id: string): readonly string[] | undefined {
  if (id in doc.actions || id in doc.logic) return doc.path;
  if (id in doc.program.actions || id in doc.program.logic) return [];
  const owner = Object.values(doc.functions).find((each) => id in each.actions || id in each.logic);
  return owner && [owner.id];
}

/** Return an action of the program or of any function. */
export function anyAction(doc: OpenDocument, id: string): OpenDocument["actions"][string] | undefined {
  const bodies = [doc, doc.program, ...Object.values(doc.functions)];
  return bodies.find((each) => id in each.actions)?.actions[id];
}

/** Return the actions of a function with the points above which they are shown; the same object without a change. */
function placed(doc: OpenDocument, { id, actions }: OpenFunction): OpenFunction["actions"] {
  const used = Object.values(actions).map((each) => pointUsed(doc, each));
  const call = Object.values(doc.program.actions).find((each) => each.type.startsWith(`${id}/`));
  let at = used.find((each) => each !== undefined) ?? call?.pointId ?? Object.keys(doc.points)[0] ?? "";
  const found = Object.values(actions).map((each, n) => {
    at = used[n] ?? at;
    return each.pointId === at ? each : { ...each, pointId: at };
  });
  return found.every((each) => actions[each.id] === each) ? actions : byId(found);
}

/** Return the point of the last pose, position or joints that an action uses. */
export function pointUsed(doc: OpenDocument, { parameters }: Action): string | undefined {
  const points = parameters.flatMap(({ type, value }) => {
    if (type !== "pose" && type !== "joints" && type !== "position") return [];
    const key = value.replaceAll('"', "");
    const point = type === "position" ? key : (doc.orientations[key] ?? doc.joints[key])?.pointId;
    return point !== undefined && point in doc.points ? [point] : [];
  });
  return points.at(-1);
}
