/** Conditions of connections as comparisons: comparable values, new comparisons, and completeness. */

import { t } from "@lingui/core/macro";
import type { LogicComparison, LogicWhen, Operator, ProjectLogicIf } from "../protocol/types";
import type { OpenDocument, State } from "../store/state";
import { decoded } from "./json";
import { BRANCHABLE, conditionActions, isRange, linkTo, type Operand, operandAt, resultsOf, SIGNS } from "./logic";
import { OWN_PARAMETERS } from "./values";

const EQUALITY: Operator[] = ["==", "!="];
const ORDER: Operator[] = ["<", "<=", ">", ">="];
const RANGES: Operator[] = ["[]", "[)", "(]", "()"];
/** The operators for each type of value. A measured number is rarely equal to another one. */
export const OPERATORS: Record<string, Operator[]> = {
  boolean: ["=="],
  integer: [...EQUALITY, ...ORDER, ...RANGES],
  double: [...ORDER, ...RANGES],
  integer_enum: EQUALITY,
  string_enum: EQUALITY,
  string: EQUALITY,
};

/**
 * Return the fields of a connection for comparisons. One result that equals a constant becomes a `condition`, which all
 * clients understand.
 */
export function fieldsOf(
  doc: OpenDocument,
  types: State["types"],
  when: LogicWhen,
): { condition?: ProjectLogicIf; when: LogicWhen } {
  const [one] = when.comparisons;
  const none: LogicWhen = { match: "all", comparisons: [] };
  if (!one) return { when: none };
  const constant = one.operator === "==" && one.other === undefined;
  const simple = when.comparisons.length === 1 && constant && one.what.includes("/");
  if (simple && BRANCHABLE.has(operandAt(doc, types, one.what)?.type ?? ""))
    return { condition: { what: one.what, value: one.value }, when: none };
  return { when };
}

/** Return the values that a connection from an action can depend on: its own results, earlier ones, and variables. */
export function operandsOf(doc: OpenDocument, types: State["types"], id: string): Operand[] {
  if (!(id in doc.actions)) return [];
  const results = conditionActions(doc, id)
    .flatMap((each) => resultsOf(doc, types, each))
    .map((each): Operand => ({ what: linkTo(each), name: each.name, type: each.type, actionId: each.action.id }));
  const variables = Object.values(doc.parameters)
    .filter((each) => !OWN_PARAMETERS.has(each.name))
    .map((each): Operand => ({ what: each.id, name: each.name, type: each.type, actionId: "" }));
  return [...results, ...variables].filter((each) => each.type in OPERATORS);
}

const NUMBERS: ReadonlySet<string> = new Set(["integer", "double"]);

/** Return the values that can be compared with a value. */
export const othersOf = (one: Operand, operands: readonly Operand[]): Operand[] =>
  operands.filter(
    ({ what, type }) => what !== one.what && (type === one.type || (NUMBERS.has(type) && NUMBERS.has(one.type))),
  );

/** Return the operators for a value, or for two. */
export function operatorsOf(one: Operand, other?: Operand): Operator[] {
  if (!other) return OPERATORS[one.type] ?? [];
  if (one.type === "double" || other.type === "double") return ORDER;
  return one.type === "integer" ? [...EQUALITY, ...ORDER] : EQUALITY;
}

/** Return a comparison with another value, or with a constant if there is none. */
export function withOther(one: LogicComparison, operand: Operand, other: Operand | undefined): LogicComparison {
  const { what } = one;
  const operators = operatorsOf(operand, other);
  const operator = operators.includes(one.operator) ? one.operator : (operators[0] ?? "==");
  return other ? { what, operator, value: "", other: other.what } : { ...newComparison(operand, []), operator };
}

/** Return a comparison of a value to start with, which is not among the others. */
export function newComparison({ what, type }: Operand, others: LogicComparison[]): LogicComparison {
  const operators = OPERATORS[type] ?? EQUALITY;
  const values = type === "boolean" ? ["true", "false"] : type.startsWith("string") ? ['"value"'] : ["0", "1", "2"];
  for (const value of values)
    for (const operator of operators) {
      if (isRange(operator)) continue;
      const taken = others.some(
        (each) => each.what === what && each.operator === operator && each.value === value && each.other === undefined,
      );
      if (!taken) return { what, operator, value };
    }
  return { what, operator: operators[0] ?? "==", value: values[0] ?? "0" };
}

/** Return a comparison with another operator. A new range starts at the value and has the width 1. */
export function withOperator(one: LogicComparison, operator: Operator): LogicComparison {
  const { what, value, other } = one;
  if (other !== undefined) return { ...one, operator };
  if (!isRange(operator)) return { what, operator, value };
  return { what, operator, value, upper: one.upper ?? JSON.stringify(Number(decoded(value)) + 1) };
}

/** Return an operator as the text of a choice. */
export function operatorWords(operator: Operator): string {
  switch (operator) {
    case "[]":
      return t`from … to …`;
    case "[)":
      return t`from … to below …`;
    case "(]":
      return t`above … to …`;
    case "()":
      return t`between … and …`;
    default:
      return SIGNS[operator] ?? operator;
  }
}
