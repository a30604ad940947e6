/** Error exits: which kinds are free, and where an error is set. Pure functions. */

import { t } from "@lingui/core/macro";
import type { Action } from "../protocol/types";
import type { OnPoint, OpenDocument } from "../store/state";
import { ANY, KIND_NAMES } from "./errorKinds";
import { after, before, errorExits, incoming, outgoing, placeOf, START } from "./logic";

/** Names of the parts of an error in a link. */
const PARTS = 3;

/** A part of the error of an action: the name of the device, the kind, or the text for the operator. */
interface ErrorPart {
  action: OnPoint<Action>;
  index: number;
  name: string;
}

/** Return the parts of an error in words. */
export const partNames = (): string[] => [t`failed device`, t`kind of the error`, t`text of the error`];

/** Return the kinds of errors that no other exit of the action has; any error first, as most users want it. */
export function freeKinds(doc: OpenDocument, from: string, item = ""): string[] {
  const taken = new Set(
    errorExits(doc, from)
      .filter((each) => each.id !== item)
      .flatMap((each) => each.error_kinds ?? []),
  );
  return [ANY, ...Object.keys(KIND_NAMES).filter((each) => each !== ANY)].filter((each) => !taken.has(each));
}

/** Return the kinds of an exit after one of them was switched: any error stands alone; the last one stays. */
export function switched(kinds: readonly string[], kind: string): string[] {
  if (kind === ANY) return [ANY];
  const rest = kinds.filter((each) => each !== ANY);
  if (!rest.includes(kind)) return [...rest, kind];
  return rest.length > 1 ? rest.filter((each) => each !== kind) : rest;
}

/** Return whether an action has failed on all paths to an item: one of its exits is on all of them. */
export function hasFailed(doc: OpenDocument, action: string, at: string): boolean {
  return errorExits(doc, action).some((exit) => !reachedWithout(doc, exit.id).has(at));
}

/** Return the items that are reached from Start without a connection. */
function reachedWithout(doc: OpenDocument, exit: string): Set<string> {
  const found = new Set<string>([START]);
  const waiting = [START];
  for (let id = waiting.pop(); id !== undefined; id = waiting.pop())
    for (const item of outgoing(doc, id)) {
      const next = placeOf(item.end);
      if (item.id === exit || found.has(next)) continue;
      found.add(next);
      waiting.push(next);
    }
  return found;
}

/** Return the parts of errors that an action can use. An unconnected one can use all but those that depend on it. */
export function usableErrors(doc: OpenDocument, id: string): ErrorPart[] {
  const names = partNames();
  const free = incoming(doc, id).length === 0;
  const order = free ? after(doc, id) : before(doc, id);
  return Object.values(doc.actions)
    .filter(({ id: other, error_output }) => {
      if (!error_output || other === id) return false;
      return free ? !order.has(other) : order.has(other) && hasFailed(doc, other, id);
    })
    .flatMap((action) => names.map((name, index) => ({ action, index, name })));
}

export const linkToError = ({ action, index }: { action: { id: string }; index: number }): string =>
  `${action.id}/error/${index}`;

/** Return the part of an error that a link names; undefined if it names none, or one that is not stored. */
export function errorAt(doc: OpenDocument, link: string): ErrorPart | undefined {
  const [id = "", flow, number = ""] = link.split("/");
  const action = doc.actions[id];
  const index = Number(number);
  if (flow !== "error" || !action?.error_output || !(index < PARTS)) return undefined;
  return { action, index, name: partNames()[index] ?? "" };
}
