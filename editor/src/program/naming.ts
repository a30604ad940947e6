/** Names that are not taken yet. */

import type { OpenDocument } from "../store/state";

/** Give the name itself, or with the first number that makes it new. */
export function freeName(base: string, taken: Iterable<string>): string {
  const names = new Set(taken);
  if (!names.has(base)) return base;
  for (let number = 2; ; number++) {
    const name = `${base}_${number}`;
    if (!names.has(name)) return name;
  }
}

/** An action's or parameter's name as words. */
export function words(name: string): string {
  return name.replaceAll("_", " ");
}

export function actionNames(doc: OpenDocument): string[] {
  return Object.values(doc.actions).map((each) => each.name);
}

/** Names of all results that are kept: no two may be called the same. */
export function outputNames(doc: OpenDocument): string[] {
  return Object.values(doc.actions).flatMap((each) => each.flows.flatMap((flow) => flow.outputs));
}

/** Names for the results of a new action, by what it is called and how many there are. */
export function newOutputs(doc: OpenDocument, method: string, count: number): string[] {
  const taken = outputNames(doc);
  const names: string[] = [];
  for (let index = 0; index < count; index++) {
    const base = count === 1 ? `${method}_result` : `${method}_result_${index + 1}`;
    names.push(freeName(base, [...taken, ...names]));
  }
  return names;
}
