/** What can follow an action of a program: results, conditions and free branches. */

import { plural, t } from "@lingui/core/macro";
import { decimal } from "../formats";
import type {
  Action,
  LogicComparison,
  LogicItem,
  LogicWhen,
  ObjectAction,
  Operator,
  ParameterMeta,
  ProjectLogicIf,
  ProjectParameter,
} from "../protocol/types";
import { perObject } from "../store/memo";
import type { Of, OpenDocument, OpenFunction, State } from "../store/state";
import { decoded } from "./decoded";
import { errorWords } from "./errorKinds";
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

export * from "./steps";

/** Types of results that a condition of all clients can test. */
export const BRANCHABLE: ReadonlySet<string> = new Set(["boolean", "integer", "integer_enum", "string_enum"]);

/** Return the description of an action by its type; undefined if unknown. */
export function metaOf(
  types: State["types"],
  doc: OpenDocument,
  action: Pick<Action, "type">,
): ObjectAction | undefined {
  const [objectId = "", method] = action.type.split("/");
  const called = doc.functions[objectId];
  if (called) return callMeta(types, doc, called);
  const type = doc.objects[objectId]?.type;
  return type === undefined ? undefined : types.actions[type]?.find((each) => each.name === method);
}

/** Method of an action that calls a function. */
export const CALL = "call";
/** Type of a parameter that passes a parameter of the function on. */
export const PASSED_ON = "function_parameter";

/** Return the function that an action calls; undefined if it calls none. */
export const calledBy = (doc: OpenDocument, action: Pick<Action, "type"> | undefined): OpenFunction | undefined =>
  doc.functions[action?.type.split("/")[0] ?? ""];

const callMetas = perObject((_: OpenDocument) => perObject((_: State["types"]) => new Map<string, ObjectAction>()));

/** Return the description of the calls of a function; its parameters have the range of their first use. */
export function callMeta(types: State["types"], doc: OpenDocument, called: OpenFunction): ObjectAction {
  const known = callMetas(doc)(types);
  const meta = known.get(called.id) ?? {
    name: CALL,
    parameters: called.parameters.map(({ name, type }): ParameterMeta => {
      const { extra, description } = firstUse(types, doc, called, name) ?? {};
      return {
        name,
        type,
        dynamic_value: false,
        ...(extra !== undefined && { extra }),
        ...(description !== undefined && { description }),
      };
    }),
    returns: called.returns.map((each) => each.type),
    disabled: false,
    meta: { composite: true, hidden: false, cancellable: false },
  };
  known.set(called.id, meta);
  return meta;
}

function firstUse(
  types: State["types"],
  doc: OpenDocument,
  { actions }: OpenFunction,
  name: string,
): ParameterMeta | undefined {
  for (const action of Object.values(actions)) {
    const use = action.parameters.find((each) => each.type === PASSED_ON && decoded(each.value) === name);
    if (use) return metaOf(types, doc, action)?.parameters.find((each) => each.name === use.name);
  }
  return undefined;
}

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

export interface Result {
  action: Of<Action>;
  index: number;
  name: string;
  type: string;
}

/** Return the variable with a name, in which actions store results. */
export const variableNamed = (doc: OpenDocument, name: string): ProjectParameter | undefined =>
  Object.values(doc.parameters).find((each) => each.variable && each.name === name);

/** Return the results of an action that are stored under their own names, not in variables. */
export function resultsOf(doc: OpenDocument, types: State["types"], action: Of<Action>): Result[] {
  const returns = metaOf(types, doc, action)?.returns ?? [];
  const outputs = action.flows.find((flow) => flow.type === "default")?.outputs ?? [];
  return returns.flatMap((type, index) => {
    const name = outputs[index];
    return name === undefined || variableNamed(doc, name) ? [] : [{ action, index, name, type }];
  });
}

/**
 * Return the results of a type that an action can use: those of actions before it. An unconnected action can use all
 * results except those that depend on it.
 */
export function usable(doc: OpenDocument, types: State["types"], id: string, type: string): Result[] {
  const earlier = before(doc, id);
  const later = after(doc, id);
  const free = incoming(doc, id).length === 0;
  return Object.values(doc.actions)
    .filter((each) => each.id !== id && (free ? !later.has(each.id) : earlier.has(each.id)))
    .filter((each) => !canHaveFailed(doc, each.id, id))
    .flatMap((each) => resultsOf(doc, types, each))
    .filter((result) => result.type === type);
}

/** Return whether a path leads from an error exit of an action to an item: the action has no results there. */
export function canHaveFailed(doc: OpenDocument, action: string, at: string): boolean {
  const ends = errorExits(doc, action).map((each) => placeOf(each.end));
  return ends.some((end) => end === at || after(doc, end).has(at));
}

export const linkTo = (result: Result): string => `${result.action.id}/default/${result.index}`;

/** Return the result that a link or condition names. */
export function resultAt(doc: OpenDocument, types: State["types"], link: string): Result | undefined {
  const [id = "", , index = ""] = link.split("/");
  const action = doc.actions[id];
  return action && resultsOf(doc, types, action).find((each) => each.index === Number(index));
}

/** Return the actions whose results a connection from an action can depend on: itself first, then earlier ones. */
export function conditionActions(doc: OpenDocument, id: string): Of<Action>[] {
  const own = doc.actions[id];
  if (!own) return [];
  const earlier = before(doc, id);
  const others = Object.values(doc.actions).filter(
    (each) => each.id !== id && earlier.has(each.id) && !canHaveFailed(doc, each.id, id),
  );
  return [own, ...others];
}

/** Return the results that a condition of all clients can test, for a connection from an action. */
export function conditionsOf(doc: OpenDocument, types: State["types"], id: string): Result[] {
  return conditionActions(doc, id)
    .flatMap((each) => resultsOf(doc, types, each))
    .filter((each) => BRANCHABLE.has(each.type));
}

// ------------------------------------------------------------------------------------------------ comparisons
/** A value that a condition can compare: a result or a variable of the project. */
export interface Operand {
  what: string;
  name: string;
  type: string;
  /** Id of the action whose result it is; empty for a variable. */
  actionId: string;
}

/** Signs of operators that are not their own text. */
export const SIGNS: Partial<Record<Operator, string>> = { "==": "=", "!=": "≠", "<=": "≤", ">=": "≥" };
/** Longest condition that is shown in full at a connection, characters. */
const LONGEST = 32;

/** Return the condition of a connection as comparisons; empty without one. */
export function whenOf({ condition, when }: Pick<LogicItem, "condition" | "when">): LogicWhen {
  if (when && when.comparisons.length > 0) return when;
  if (!condition) return { match: "all", comparisons: [] };
  return { match: "all", comparisons: [{ what: condition.what, operator: "==", value: condition.value }] };
}

export const isRange = (operator: Operator): boolean => "[(".includes(operator[0] ?? "-");

/** Return the value that a comparison names. */
export function operandAt(doc: OpenDocument, types: State["types"], what: string): Operand | undefined {
  const parameter = doc.parameters[what];
  if (parameter) return { what, name: parameter.name, type: parameter.type, actionId: "" };
  const result = what.includes("/") ? resultAt(doc, types, what) : undefined;
  return result && { what, name: result.name, type: result.type, actionId: result.action.id };
}

function valueWords(json: string | undefined): string {
  const value = decoded(json);
  if (typeof value === "boolean") return value ? t`yes` : t`no`;
  if (typeof value === "number") return decimal(value);
  return value === "" ? '""' : String(value);
}

/** Return a comparison as text: "3 ≤ n < 7", "passed = yes". */
export function comparisonWords(doc: OpenDocument, types: State["types"], one: LogicComparison): string {
  const name = operandAt(doc, types, one.what)?.name ?? t`result`;
  if (!isRange(one.operator)) return `${name} ${SIGNS[one.operator] ?? one.operator} ${valueWords(one.value)}`;
  const [below, above] = [one.operator[0] === "[" ? "≤" : "<", one.operator[1] === "]" ? "≤" : "<"];
  return `${valueWords(one.value)} ${below} ${name} ${above} ${valueWords(one.upper)}`;
}

/** Return comparisons as text. Of a long text, only the first comparison and the number of the others are shown. */
export function whenWords(doc: OpenDocument, types: State["types"], { match, comparisons }: LogicWhen): string {
  const [first = "", ...others] = comparisons.map((each) => comparisonWords(doc, types, each));
  const all = others.reduce((text, each) => (match === "all" ? t`${text} and ${each}` : t`${text} or ${each}`), first);
  if (all.length <= LONGEST || others.length === 0) return all;
  return match === "all"
    ? plural(others.length, { one: `${first} and # more`, other: `${first} and # more` })
    : plural(others.length, { one: `${first} or # more`, other: `${first} or # more` });
}

// ------------------------------------------------------------------------------------------------ branches
/** What a new connection from an action has to be to go with the existing ones. */
export interface NewStep {
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
