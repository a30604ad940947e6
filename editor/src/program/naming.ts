/** Free names, and names as words. */

import { translate } from "../i18n/serverMessages";
import type { Action } from "../protocol/types";
import { scopeOf } from "../store/scope";
import type { OpenDocument, OpenFunction } from "../store/state";

/** Return a name, with the first number that makes it unique. */
export function freeName(base: string, taken: Iterable<string>): string {
  const names = new Set(taken);
  if (!names.has(base)) return base;
  for (let number = 2; ; number++) {
    const name = `${base}_${number}`;
    if (!names.has(name)) return name;
  }
}

/** Return the name of an action or parameter as words in the user's language. */
export function words(name: string): string {
  return translate({ text: name.replaceAll("_", " ") });
}

/** Return the names of all actions of the program and of functions, which have to be unique. */
export function actionNames(doc: OpenDocument): string[] {
  const bodies = [doc.program, ...Object.values(doc.functions)];
  return bodies.flatMap(({ actions }) => Object.values(actions).map((each) => each.name));
}

/** Return the names of variables, parameters, stored results and errors; unique in the open program or function. */
export function outputNames(doc: OpenDocument): string[] {
  const variables = Object.values(doc.parameters).flatMap((each) => (each.variable ? [each.name] : []));
  const stored = Object.values(doc.actions).flatMap(({ flows, error_output }) => [
    ...flows.flatMap((flow) => flow.outputs),
    ...(error_output ? [error_output] : []),
  ]);
  const passed = doc.functions[scopeOf(doc)]?.parameters.map((each) => each.name) ?? [];
  return [...variables, ...passed, ...stored];
}

/** Return names for the results of a new action. */
export function newOutputs(doc: OpenDocument, method: string, count: number): string[] {
  const taken = outputNames(doc);
  const names: string[] = [];
  for (let index = 0; index < count; index++) {
    const base = count === 1 ? `${method}_result` : `${method}_result_${index + 1}`;
    names.push(freeName(base, [...taken, ...names]));
  }
  return names;
}

/** Return names for the results of a call: those that they have in the function, as far as these are free. */
export function resultNames(doc: OpenDocument, { actions, returns }: OpenFunction): string[] {
  const taken = outputNames(doc);
  return returns.map(({ link }) => {
    const [id = "", , index] = link.split("/");
    const inner = actions[id]?.flows.find((each) => each.type === "default")?.outputs[Number(index)];
    const name = freeName(inner ?? "result", taken);
    taken.push(name);
    return name;
  });
}

/** Return a name for the error of an action. */
export const freeErrorName = (doc: OpenDocument, action: Pick<Action, "type" | "name">): string =>
  freeName(`${action.type.split("/")[1] ?? action.name}_error`, outputNames(doc));
