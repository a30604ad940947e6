/**
 * The names and results of actions, and conditions as text. Part of the shell; the successors of actions are in
 * `logic.ts`.
 */

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
  ProjectParameter,
} from "../protocol/types";
import { perObject } from "../store/memo";
import type { OnPoint, OpenDocument, OpenFunction, State } from "../store/state";
import { decoded } from "./json";

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

export interface Result {
  action: OnPoint<Action>;
  index: number;
  name: string;
  type: string;
}

/** Return the variable with a name, in which actions store results. */
export const variableNamed = (doc: OpenDocument, name: string): ProjectParameter | undefined =>
  Object.values(doc.parameters).find((each) => each.variable && each.name === name);

/** Return the results of an action that are stored under their own names, not in variables. */
export function resultsOf(doc: OpenDocument, types: State["types"], action: OnPoint<Action>): Result[] {
  const returns = metaOf(types, doc, action)?.returns ?? [];
  const outputs = action.flows.find((flow) => flow.type === "default")?.outputs ?? [];
  return returns.flatMap((type, index) => {
    const name = outputs[index];
    return name === undefined || variableNamed(doc, name) ? [] : [{ action, index, name, type }];
  });
}

export const linkTo = (result: Result): string => `${result.action.id}/default/${result.index}`;

/** Return the result that a link or condition names. */
export function resultAt(doc: OpenDocument, types: State["types"], link: string): Result | undefined {
  const [id = "", , index = ""] = link.split("/");
  const action = doc.actions[id];
  return action && resultsOf(doc, types, action).find((each) => each.index === Number(index));
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
  if (!isRange(one.operator)) {
    const other =
      one.other === undefined ? valueWords(one.value) : (operandAt(doc, types, one.other)?.name ?? t`result`);
    return `${name} ${SIGNS[one.operator] ?? one.operator} ${other}`;
  }
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
