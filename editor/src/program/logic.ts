/** The possible successors of an action: results, conditions and free branches. */

import { t } from "@lingui/core/macro";
import type { Action, LogicItem, ProjectLogicIf } from "../protocol/types";
import type { OnPoint, OpenDocument, State } from "../store/state";
import { errorWords } from "./errorKinds";
import { linkTo, type Result, resultAt, resultsOf, whenOf, whenWords } from "./operands";
import { runnerOf } from "./parallel";
import {
  END,
  errorExits,
  hasComparisons,
  incoming,
  isConditional,
  isErrorExit,
  nextSteps,
  outgoing,
  placeOf,
  START,
} from "./steps";

export * from "./operands";
export * from "./steps";

/** Types of results that a `condition`, which all clients understand, can test. */
export const BRANCHABLE: ReadonlySet<string> = new Set(["boolean", "integer", "integer_enum", "string_enum"]);

function reached(doc: OpenDocument, from: string, next: (doc: OpenDocument, id: string) => string[]): Set<string> {
  const found = new Set<string>();
  const waiting = next(doc, from);
  for (let id = waiting.pop(); id !== undefined; id = waiting.pop()) {
    if (found.has(id)) continue;
    found.add(id);
    waiting.push(...next(doc, id));
  }
  return found;
}

/** Return all actions that can run after an action. */
export const after = (doc: OpenDocument, id: string): Set<string> =>
  reached(doc, id, (of, each) => outgoing(of, each).map((item) => placeOf(item.end)));
/** Return all actions that can run before an action. */
export const before = (doc: OpenDocument, id: string): Set<string> =>
  reached(doc, id, (of, each) => incoming(of, each).map((item) => placeOf(item.start)));

/**
 * Return the results of a type that an action can use: those of actions before it. An unconnected action can use all
 * results except those that depend on it. Calls that run at once cannot use results of each other.
 */
export function usable(doc: OpenDocument, types: State["types"], id: string, type: string): Result[] {
  const own = runnerOf(doc, id);
  const earlier = before(doc, own);
  const later = after(doc, own);
  const free = incoming(doc, own).length === 0;
  return Object.values(doc.actions)
    .filter((each) => {
      const runner = runnerOf(doc, each.id);
      return runner !== own && (free ? !later.has(runner) : earlier.has(runner)) && !canHaveFailed(doc, runner, own);
    })
    .flatMap((each) => resultsOf(doc, types, each))
    .filter((result) => result.type === type);
}

/** Return whether a path leads from an error exit of an action to an item: the action has no results there. */
export function canHaveFailed(doc: OpenDocument, action: string, at: string): boolean {
  const ends = errorExits(doc, action).map((each) => placeOf(each.end));
  return ends.some((end) => end === at || after(doc, end).has(at));
}

/**
 * Return the actions whose results a connection from an action can depend on: itself first, then the calls that it runs
 * and earlier ones.
 */
export function conditionActions(doc: OpenDocument, id: string): OnPoint<Action>[] {
  const own = doc.actions[id];
  if (!own) return [];
  const earlier = before(doc, id);
  const others = Object.values(doc.actions).filter((each) => {
    const runner = runnerOf(doc, each.id);
    return each.id !== id && (runner === id || (earlier.has(runner) && !canHaveFailed(doc, runner, id)));
  });
  return [own, ...others];
}

/** Return the results that a `condition` of a connection from an action can test. */
export function conditionsOf(doc: OpenDocument, types: State["types"], id: string): Result[] {
  return conditionActions(doc, id)
    .flatMap((each) => resultsOf(doc, types, each))
    .filter((each) => BRANCHABLE.has(each.type));
}

// ------------------------------------------------------------------------------------------------ branches
/** The kind of a new connection from an action that fits the existing connections. */
interface NewStep {
  condition?: ProjectLogicIf;
  /** The existing connection, which needs a condition first. */
  first?: { item: LogicItem; condition: ProjectLogicIf };
}

/** Return a free branch of `from`, or a sentence if there is none. */
export function freeStep(doc: OpenDocument, types: State["types"], from: string): NewStep | string {
  const siblings = nextSteps(doc, from);
  if (siblings.length === 0) return {};
  // Next to comparisons, a connection without a condition is for all other values.
  if (siblings.some(hasComparisons) && siblings.every(isConditional)) return {};
  if (from === START) return t`A program has one first action. Move the connection from Start instead.`;
  const asked = siblings.find((each) => each.condition)?.condition;
  const plain = siblings.find((each) => !isConditional(each));
  const own = asked ? resultAt(doc, types, asked.what) : conditionsOf(doc, types, from)[0];
  const name = doc.actions[from]?.name ?? t`This action`;
  if (!own) return t`${name} already has a next step, and no result to branch on.`;
  const what = asked?.what ?? linkTo(own);
  const taken = siblings.flatMap((each) => (each.condition?.what === what ? [each.condition.value] : []));
  const free = firstFree(own.type, taken);
  if (free === undefined) return t`${name} has no free branch.`;
  if (own.type !== "boolean" || !plain) return { condition: { what, value: free } };
  return { condition: { what, value: "false" }, first: { item: plain, condition: { what, value: "true" } } };
}

function firstFree(type: string, taken: string[]): string | undefined {
  if (type === "boolean") return ["true", "false"].find((each) => !taken.includes(each));
  if (type === "string_enum") {
    for (let number = 1; ; number++) if (!taken.includes(`"value ${number}"`)) return `"value ${number}"`;
  }
  for (let number = 0; ; number++) if (!taken.includes(String(number))) return String(number);
}

/**
 * Return why a connection cannot lead to an item; an empty string if it can. The server decides in the end.
 *
 * `item` is the connection if it exists, `error`: whether it is an error exit.
 */
export function cannotLead(
  doc: OpenDocument,
  from: string,
  to: string,
  item = "",
  error = isErrorExit(doc.logic[item]),
): string {
  if (to === START) return t`Start cannot follow a step.`;
  if (from === END) return t`Nothing can follow End.`;
  if (from === to) return t`An action cannot follow itself.`;
  if (from === START && to === END) return t`Put an action between Start and End.`;
  if (from === START && error) return t`Start cannot fail.`;
  const others = outgoing(doc, from).filter((each) => each.id !== item);
  if (others.some((each) => placeOf(each.end) === to && isErrorExit(each) === error))
    return t`These steps are already connected.`;
  if (after(doc, to).has(from)) return t`This connection would create a loop.`;
  return "";
}

/** Return a condition as text: "passed is yes", "on error". */
export function conditionWords(doc: OpenDocument, types: State["types"], item: LogicItem): string {
  const { condition } = item;
  if (isErrorExit(item)) return errorWords(item.error_kinds);
  if (hasComparisons(item)) return whenWords(doc, types, whenOf(item));
  if (!condition) return nextSteps(doc, placeOf(item.start)).length > 1 ? t`else` : "";
  const result = resultAt(doc, types, condition.what);
  const own = result?.action.id === placeOf(item.start);
  const value =
    condition.value === "true"
      ? t`yes`
      : condition.value === "false"
        ? t`no`
        : condition.value.replace(/^"(.*)"$/, "$1");
  return own && result?.type === "boolean" ? value : `${result?.name ?? t`result`} = ${value}`;
}
