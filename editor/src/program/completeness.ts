/**
 * Whether exactly one connection of an action applies for all values: the same proof as that of Build, so that a user
 * sees what is missing while editing. Pure functions.
 */

import { t } from "@lingui/core/macro";
import { decimal } from "../formats";
import type { LogicComparison, LogicItem, LogicWhen } from "../protocol/types";
import type { OpenDocument, State } from "../store/state";
import { decoded } from "./json";
import { nextSteps, operandAt, outgoing, placeOf, START, whenOf } from "./logic";
import { runnerOf } from "./parallel";
import { hasComparisons, isConditional, isErrorExit } from "./steps";

type Value = boolean | number | string;
type Values = Record<string, Value>;
/** Maximum number of combinations of values for which conditions are tested, as on the server. */
const MAX_CASES = 2000;

/** The coverage of all values by conditions that are tested in order. */
interface Cases {
  /** Indexes of the conditions that never apply. */
  unused: number[];
  /** Values for which no condition is true. */
  gap?: Values;
  /** Whether all values were tested. There may be too many combinations. */
  known: boolean;
}

const otherOf = ({ other }: LogicComparison): string[] => (other === undefined ? [] : [other]);

function holdsFor(one: LogicComparison, values: Values): boolean {
  const value = values[one.what] as Value;
  const limit = (one.other === undefined ? decoded(one.value) : values[one.other]) as Value;
  switch (one.operator) {
    case "==":
      return value === limit;
    case "!=":
      return value !== limit;
    case "<":
      return value < limit;
    case "<=":
      return value <= limit;
    case ">":
      return value > limit;
    case ">=":
      return value >= limit;
    default: {
      const upper = decoded(one.upper) as Value;
      const above = one.operator[0] === "[" ? value >= limit : value > limit;
      return above && (one.operator[1] === "]" ? value <= upper : value < upper);
    }
  }
}

const holds = ({ match, comparisons }: LogicWhen, values: Values): boolean =>
  match === "all"
    ? comparisons.every((one) => holdsFor(one, values))
    : comparisons.some((one) => holdsFor(one, values));

/** Return the values that are compared with each other, directly or through others, as groups. */
function groupsOf(comparisons: readonly LogicComparison[]): string[][] {
  const groups = new Map<string, string[]>();
  for (const one of comparisons) {
    const joined = [...new Set([one.what, ...otherOf(one)].flatMap((what) => groups.get(what) ?? [what]))];
    for (const what of joined) groups.set(what, joined);
  }
  return [...new Set(groups.values())];
}

/**
 * Return values that stand for all values of a type, which differ only in comparisons. Between two constants there are
 * as many as values in the group, so that these have any order.
 */
function samples(type: string, constants: Value[], types: readonly string[]): Value[] {
  if (type === "boolean") return [true, false];
  const count = types.length;
  if (type.startsWith("string")) {
    const texts = new Set(constants.filter((each) => typeof each === "string"));
    const others: string[] = [];
    for (let other = "other"; others.length < count; other += "_") if (!texts.has(other)) others.push(other);
    return [...texts, ...others];
  }
  const numbers = constants.filter((each) => typeof each === "number");
  if (numbers.length === 0) numbers.push(0);
  const near = new Set<number>();
  for (const each of numbers.flatMap((one) => [Math.floor(one), Math.ceil(one)]))
    for (let shift = 0; shift <= count; shift++) near.add(each + shift).add(each - shift);
  if (type !== "double") return [...near];
  const fixed = [...new Set([...numbers, ...(types.includes("integer") ? near : [])])].sort((a, b) => a - b);
  const [first = 0, last = 0] = [fixed[0], fixed.at(-1)];
  const parts = Array.from({ length: count }, (_, n) => n + 1);
  return [
    ...fixed,
    ...fixed
      .slice(1)
      .flatMap((high, n) => parts.map((part) => (high * part + (fixed[n] ?? 0) * (count + 1 - part)) / (count + 1))),
    ...parts.map((part) => first - part * Math.max(1, Math.abs(first))),
    ...parts.map((part) => last + part * Math.max(1, Math.abs(last))),
  ];
}

/** Return what conditions, tested in order, do for all values; undefined if a value does not exist. */
export function casesOf(doc: OpenDocument, types: State["types"], conditions: readonly LogicWhen[]): Cases | undefined {
  const comparisons = conditions.flatMap((each) => each.comparisons);
  const typeOf = (what: string) => operandAt(doc, types, what)?.type;
  let cases: Values[] = [{}];
  for (const group of groupsOf(comparisons)) {
    const kinds = group.flatMap((what) => typeOf(what) ?? []);
    if (kinds.length < group.length) return undefined;
    const constants = comparisons
      .filter((one) => one.other === undefined && group.includes(one.what))
      .flatMap((one) => [decoded(one.value), decoded(one.upper)].filter((each) => each !== undefined) as Value[]);
    for (const [n, what] of group.entries()) {
      const values = samples(kinds[n] ?? "", constants, kinds);
      if (cases.length * values.length > MAX_CASES) return { unused: [], known: false };
      cases = cases.flatMap((each) => values.map((value) => ({ ...each, [what]: value })));
    }
  }
  const unused = new Set(conditions.keys());
  let gap: Values | undefined;
  for (const values of cases) {
    const taken = conditions.findIndex((each) => holds(each, values));
    if (taken >= 0) unused.delete(taken);
    else gap ??= values;
  }
  return { unused: [...unused], known: true, ...(gap && { gap }) };
}

function valuesWords(doc: OpenDocument, types: State["types"], values: Values): string {
  const word = (value: Value) =>
    typeof value === "boolean" ? (value ? t`yes` : t`no`) : typeof value === "number" ? decimal(value) : `"${value}"`;
  return Object.entries(values)
    .map(([what, value]) => `${operandAt(doc, types, what)?.name ?? t`result`} = ${word(value)}`)
    .join(", ");
}

/** The problem of the conditions of the connections from an action. */
interface BranchProblem {
  /** Id of the action, or of the connection. */
  id: string;
  text: string;
}

/** Return what Build would report about the conditions of the connections from an action, if some have comparisons. */
export function branchProblems(doc: OpenDocument, types: State["types"], id: string): BranchProblem[] {
  const steps = nextSteps(doc, id);
  if (!steps.some(hasComparisons)) return [];
  const name = doc.actions[id]?.name ?? "";
  const conditional = steps.filter(isConditional);
  const otherwise = steps.find((each) => !isConditional(each));
  const cases = casesOf(doc, types, conditional.map(whenOf));
  if (!cases) return [];
  const { gap } = cases;
  const never = cases.unused.flatMap((n) => conditional[n] ?? []);
  if (otherwise && cases.known && !gap) never.push(otherwise);
  const to = (item: LogicItem) => doc.actions[placeOf(item.end)]?.name ?? t`End`;
  const found = never.map((item) => ({
    id: item.id,
    text: t`${name}: the step to ${to(item)} is never taken, because other conditions are met first.`,
  }));
  if (otherwise) return found;
  if (!cases.known) found.push({ id, text: t`${name}: too many values to check. Add a step without a condition.` });
  else if (gap) {
    const values = valuesWords(doc, types, gap);
    found.push({ id, text: t`${name}: no next step if ${values}. Add a step without a condition.` });
  }
  return found;
}

/** Return whether a path leads from Start to an action on which another action has not succeeded before. */
export function canLackResults(doc: OpenDocument, source: string, at: string): boolean {
  const [from, to] = [runnerOf(doc, source), runnerOf(doc, at)];
  const seen = new Set([START]);
  const waiting = [START];
  for (let id = waiting.pop(); id !== undefined; id = waiting.pop())
    for (const item of outgoing(doc, id)) {
      const next = placeOf(item.end);
      if ((id === from && !isErrorExit(item)) || seen.has(next)) continue;
      if (next === to) return true;
      seen.add(next);
      waiting.push(next);
    }
  return false;
}
