/** Functions of a project: their calls, and which actions become one. Pure functions. */

import { t } from "@lingui/core/macro";
import type { Action } from "../protocol/types";
import { inScope, pointUsed, scopeOf } from "../store/scope";
import type { OnPoint, OpenDocument, OpenFunction } from "../store/state";
import { decoded } from "./json";
import { ordered } from "./listing";
import { after, before, calledBy, END, outgoing, PASSED_ON, placeOf, START } from "./logic";
import { freeName } from "./naming";
import { callsIn, isParallel } from "./parallel";

/** Return the device and the point of an action as text, the function that it calls, or the calls that it runs. */
export function detailOf(doc: OpenDocument, action: OnPoint<Action>): string {
  if (isParallel(action))
    return t`in parallel: ${callsIn(doc, action)
      .map((each) => each.name)
      .join(", ")}`;
  const called = calledBy(doc, action);
  if (called) return t`function ${called.name}`;
  const object = doc.objects[action.type.split("/")[0] ?? ""]?.name ?? "?";
  // Actions of a function belong to no point, but may use one.
  if (scopeOf(doc) && !pointUsed(doc, action)) return object;
  const point = doc.points[action.pointId]?.name ?? "?";
  return t`${object} at ${point}`;
}

/** Return all calls of a function, and the functions in which they are; an empty name stands for the program. */
export function callsOf(doc: OpenDocument, id: string): { action: OnPoint<Action>; within: string }[] {
  return [{ ...doc.program, name: "" }, ...Object.values(doc.functions)].flatMap(({ actions, name }) =>
    Object.values(actions)
      .filter((each) => calledBy(doc, each)?.id === id)
      .map((action) => ({ action, within: name })),
  );
}

/** Return whether a call of this function from the open one would be recursive. */
export function recursive(doc: OpenDocument, id: string): boolean {
  const open = scopeOf(doc);
  const reaches = (from: string): boolean =>
    from === open ||
    Object.values(doc.functions[from]?.actions ?? {}).some((each) => {
      const called = calledBy(doc, each);
      return called !== undefined && reaches(called.id);
    });
  return open !== "" && reaches(id);
}

/**
 * Return the selected actions after a tap on one, in the order of execution: it is removed, or added with all between
 * it and the others.
 */
export function picked(doc: OpenDocument, ids: readonly string[], id: string): string[] {
  if (ids.includes(id)) return ids.filter((each) => each !== id);
  const [later, earlier] = [after(doc, id), before(doc, id)];
  const between = (each: string) => {
    if (ids.includes(each) || each === id) return true;
    const [from, to] = [before(doc, each), after(doc, each)];
    return ids.some((one) => (from.has(one) && earlier.has(each)) || (later.has(each) && to.has(one)));
  };
  return ordered(doc).filter(between);
}

/** Return a name for a function that is made of actions. */
export function suggestedName(doc: OpenDocument, ids: readonly string[]): string {
  const inside = new Set(ids);
  const names = ids.map((id) => doc.actions[id]?.name ?? "");
  const first = ids.findIndex((id) => ![...before(doc, id)].some((each) => inside.has(each)));
  const last = ids.findIndex((id) => ![...after(doc, id)].some((each) => inside.has(each)));
  const [from = "", to = ""] = [names[first] ?? names[0], names[last] ?? names.at(-1)];
  const base = from === to ? from : `${from}_to_${to}`;
  const clean = base.replace(/[^\p{L}\p{N}_]+/gu, "_").replace(/^_+|_+$/g, "");
  return freeName(`do_${clean}`, functionNames(doc));
}

export const functionNames = (doc: OpenDocument): string[] => Object.values(doc.functions).map((each) => each.name);

/** Return the actions of a function that use one of its parameters. */
export const usersOfParameter = ({ actions }: OpenFunction, name: string): OnPoint<Action>[] =>
  Object.values(actions).filter((action) =>
    action.parameters.some((each) => each.type === PASSED_ON && decoded(each.value) === name),
  );

/** Return whether an action runs on all paths from Start to End of the open program or function. */
export function onAllPaths(doc: OpenDocument, id: string): boolean {
  const seen = new Set([START, id]);
  const waiting = [START];
  for (let at = waiting.pop(); at !== undefined; at = waiting.pop())
    for (const item of outgoing(doc, at)) {
      const next = placeOf(item.end);
      if (next === END) return false;
      if (!seen.has(next)) waiting.push(next);
      seen.add(next);
    }
  return true;
}

/** A stored result of an action that a function can return. */
interface ResultOffer {
  link: string;
  name: string;
  action: string;
}

/** Return the name of a result of a function, and that of its action. */
export function resultOf(called: OpenFunction, link: string): ResultOffer | undefined {
  const [id = "", , index] = link.split("/");
  const action = called.actions[id];
  const name = action?.flows.find((each) => each.type === "default")?.outputs[Number(index)];
  return action && name !== undefined ? { link, name, action: action.name } : undefined;
}

/** Return the stored results that a function can return but does not. */
export function freeResults(doc: OpenDocument, called: OpenFunction): ResultOffer[] {
  const inside = inScope(doc, [called.id]);
  return Object.values(called.actions)
    .filter((each) => onAllPaths(inside, each.id))
    .flatMap((each) => (each.flows[0]?.outputs ?? []).map((_, index) => `${each.id}/default/${index}`))
    .filter((link) => !called.returns.some((each) => each.link === link))
    .flatMap((link) => resultOf(called, link) ?? []);
}
