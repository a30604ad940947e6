import { describe, expect, test } from "vitest";
import type { LogicComparison, LogicWhen, Match, Operator } from "../protocol/types";
import {
  fieldsOf,
  newComparison,
  OPERATORS,
  operandsOf,
  operatorsOf,
  othersOf,
  withOperator,
  withOther,
} from "./comparisons";
import { branchProblems, casesOf } from "./completeness";
import { listingOf } from "./listing";
import {
  branchKind,
  comparisonWords,
  conditionWords,
  freeStep,
  type Operand,
  operandAt,
  whenOf,
  whenWords,
} from "./logic";
import { movableRuns } from "./moving";
import { problemsOf, usersOf } from "./problems";
import { runsOf } from "./runs";
import { program, TYPES } from "./testing";

const N = "a/default/0";
const P = "b/default/0";
const compared = (what: string, operator: Operator, value: string, upper?: string): LogicComparison => ({
  what,
  operator,
  value,
  ...(upper === undefined ? {} : { upper }),
});
const all = (...comparisons: LogicComparison[]): LogicWhen => ({ match: "all", comparisons });

/** A program whose action b leads to c and d: by comparisons, or without a condition. */
function comparing(first: LogicWhen, second?: LogicWhen) {
  const doc = program({ a: "count", b: "ask", c: "act", d: "act" }, [
    ["START", "a"],
    ["a", "b"],
    ["b", "c"],
    ["b", "d"],
    ["c", "END"],
    ["d", "END"],
  ]);
  const { s2, s3 } = doc.logic;
  if (!s2 || !s3) throw new Error("connections are missing");
  s2.when = first;
  if (second) s3.when = second;
  return { doc, s2, s3 };
}

test("own results come first, then earlier ones and variables", () => {
  const { doc } = comparing(all());
  expect(operandsOf(doc, TYPES, "b").map((each) => each.name)).toEqual(["b_result", "a_result", "so_many"]);
  expect(operandsOf(doc, TYPES, "a").map((each) => each.name)).toEqual(["a_result", "so_many"]);
});

test("the comparison of a result with an equal value is sent as `condition`, which all clients know", () => {
  const { doc } = comparing(all());
  const none = all();
  expect(fieldsOf(doc, TYPES, all(compared(N, "==", "3")))).toEqual({ condition: { what: N, value: "3" }, when: none });
  for (const when of [all(compared(N, "<", "3")), all(compared("par", "==", "3")), all(compared(N, "!=", "3"))])
    expect(fieldsOf(doc, TYPES, when)).toEqual({ when });
  expect(fieldsOf(doc, TYPES, none)).toEqual({ when: none });
  expect(whenOf({ condition: { what: N, value: "3" } })).toEqual(all(compared(N, "==", "3")));
});

test("new comparisons differ from the others, and ranges start at the value", () => {
  const operand = { what: N, name: "n", type: "integer", actionId: "a" };
  const first = newComparison(operand, []);
  expect(first).toEqual(compared(N, "==", "0"));
  expect(newComparison(operand, [first])).toEqual(compared(N, "!=", "0"));
  const double = { ...operand, type: "double" };
  expect(newComparison(double, [])).toEqual(compared(N, "<", "0"));
  expect(withOperator(compared(N, "<", "2.5"), "[)")).toEqual(compared(N, "[)", "2.5", "3.5"));
  expect(withOperator(compared(N, "[)", "3", "7"), "()")).toEqual(compared(N, "()", "3", "7"));
  expect(withOperator(compared(N, "[)", "3", "7"), ">")).toEqual(compared(N, ">", "3"));
  expect(OPERATORS.double).not.toContain("==");
});

describe("words", () => {
  const { doc, s2, s3 } = comparing(all(compared(N, "[)", "3", "7"), compared(P, "==", "true")));
  test("of comparisons", () => {
    expect(conditionWords(doc, TYPES, s2)).toBe("3 ≤ a_result < 7 and 1 more");
    expect(conditionWords(doc, TYPES, s3)).toBe("else");
    expect(branchKind(s2)).toBe("value");
    const any: LogicWhen = { match: "any" as Match, comparisons: [compared("par", "!=", "3"), compared(N, ">=", "9")] };
    expect(whenWords(doc, TYPES, any)).toBe("so_many ≠ 3 or a_result ≥ 9");
    expect(operandAt(doc, TYPES, "gone/default/0")).toBeUndefined();
  });
});

test("comparisons are complete if one of them is true for all values", () => {
  const { doc } = comparing(all());
  const complete = (...conditions: LogicWhen[]) => {
    const cases = casesOf(doc, TYPES, conditions);
    return cases?.known ? cases.gap === undefined : undefined;
  };
  expect(complete(all(compared(N, "<=", "3")), all(compared(N, ">=", "4")))).toBe(true);
  expect(complete(all(compared(N, "<", "3")), all(compared(N, ">", "3")))).toBe(false);
  expect(complete(all(compared(N, "<", "3"), compared(P, "==", "true")), all(compared(N, ">=", "3")))).toBe(false);
  expect(complete(all(compared(P, "==", "true")), all(compared(P, "==", "false")))).toBe(true);
  expect(complete(all(compared("gone", "<", "3")))).toBeUndefined();
});

test("problems name incomplete comparisons and missing values", () => {
  const incomplete = comparing(all(compared(N, "<", "3")), all(compared(N, ">", "3"))).doc;
  expect(problemsOf(incomplete, TYPES).map((each) => each.text)).toEqual([
    "b: no next step if a_result = 3. Add a step without a condition.",
  ]);
  expect(problemsOf(comparing(all(compared(N, "<", "3"))).doc, TYPES)).toEqual([]);
  const missing = comparing(all(compared("gone", "<", "3"))).doc;
  expect(problemsOf(missing, TYPES).map((each) => each.text)).toEqual([
    "b: a step depends on a result that no longer exists.",
  ]);
  expect(usersOf(comparing(all(compared("par", "<", "3"))).doc, TYPES, { parameter: "par" })).toEqual(["s2"]);
});

test("after connections with comparisons, a further connection is for all other values", () => {
  const { doc } = comparing(all(compared(N, "<", "3")), all(compared(N, ">", "3")));
  expect(freeStep(doc, TYPES, "b")).toEqual({});
});

test("a result that is stored in a variable is used as the variable", () => {
  const { doc } = comparing(all());
  const [action, parameter] = [doc.actions.a, doc.parameters.par];
  if (!action || !parameter) throw new Error("the program has no action a, or no parameter");
  doc.parameters.par = { ...parameter, variable: true };
  doc.actions.a = { ...action, flows: [{ type: "default", outputs: ["so_many"] }] };
  expect(operandsOf(doc, TYPES, "b").map((each) => each.name)).toEqual(["b_result", "so_many"]);
  expect(usersOf(doc, TYPES, { parameter: "par" })).toEqual(["a"]);
});

test("comparisons of two values that Build refuses are reported while editing", () => {
  const pair = (operator: Operator, other = "par"): LogicComparison => ({ what: N, operator, value: "", other });
  const texts = (first: LogicWhen, second?: LogicWhen) =>
    branchProblems(comparing(first, second).doc, TYPES, "b").map(({ id, text }) => `${id}: ${text}`);
  expect(texts(all(pair(">=")), all(pair("<")))).toEqual([]);
  expect(texts(all(pair(">=")))).toEqual([]);
  expect(texts(all(pair(">")), all(pair("<")))).toEqual([
    "b: b: no next step if a_result = 0, so_many = 0. Add a step without a condition.",
  ]);
  expect(texts(all(pair(">="), compared(N, ">", "10")), all(pair("<")))).toHaveLength(1);
  // Three conditions of two values, of which one is contained in the others.
  expect(texts(all(pair(">=")), all(pair("==")))).toEqual([
    "s3: b: the step to d is never taken, because other conditions are met first.",
    "b: b: no next step if a_result = 0, so_many = 1. Add a step without a condition.",
  ]);
  expect(texts({ match: "any", comparisons: [pair(">="), pair("<")] })).toEqual([
    "s3: b: the step to d is never taken, because other conditions are met first.",
  ]);
  const many = Array.from({ length: 10 }, (_, n) => `${100 * n}`).map((value) => compared("par", "!=", value));
  expect(texts(all(pair(">="), ...many), all(pair("<")))).toEqual([
    "b: b: too many values to check. Add a step without a condition.",
  ]);
});

test("a condition cannot use the result of an action that runs on some paths only", () => {
  const doc = program({ a: "ask", b: "count", c: "act", d: "act" }, [
    ["START", "a"],
    ["a", "b", "true"],
    ["a", "c", "false"],
    ["b", "c"],
    ["c", "d"],
    ["c", "END"],
    ["d", "END"],
  ]);
  if (doc.logic.s4) doc.logic.s4.when = all(compared("b/default/0", "<", "3"));
  expect(problemsOf(doc, TYPES).map((each) => `${each.id}: ${each.text}`)).toEqual([
    "s4: c: a step depends on a result of b, which does not run before it on all paths.",
  ]);
});

test("a connection with comparisons is a branch in the list, and ends a sequence", () => {
  const doc = program({ a: "count", b: "act", c: "act", d: "act" }, [
    ["START", "a"],
    ["a", "b"],
    ["b", "c"],
    ["c", "d"],
    ["d", "END"],
  ]);
  const kinds = () => listingOf(doc).map((row) => row.kind);
  expect([runsOf(doc), kinds()]).toEqual([[["a", "b", "c", "d"]], ["action", "action", "action", "action"]]);
  if (doc.logic.s1) doc.logic.s1.when = all(compared(N, "<", "3"));
  expect(runsOf(doc)).toEqual([["b", "c", "d"]]);
  expect(kinds()).toEqual(["action", "branch", "action", "action", "action"]);
  expect([...movableRuns(doc).keys()]).toEqual(["b", "c", "d"]);
});

test("after an error exit, results of its action cannot be compared", () => {
  const doc = program({ a: "count", b: "ask", c: "act" }, [
    ["START", "a"],
    ["a", "b"],
    ["a", "c", "on error"],
    ["c", "b"],
    ["b", "END"],
  ]);
  const names = (id: string) => operandsOf(doc, TYPES, id).map((each) => each.name);
  expect([names("a"), names("b")]).toEqual([
    ["a_result", "so_many"],
    ["b_result", "so_many"],
  ]);
  const { s1, s2 } = doc.logic;
  if (!s1 || !s2) throw new Error("connections are missing");
  s1.when = all(compared(N, "<", "3"));
  expect([branchKind(s1), branchKind(s2)]).toEqual(["value", "error"]);
  expect([conditionWords(doc, TYPES, s1), conditionWords(doc, TYPES, s2)]).toEqual(["a_result < 3", "on error"]);
  expect(freeStep(doc, TYPES, "a")).toEqual({});
  expect(problemsOf(doc, TYPES).map((each) => each.text)).toEqual([
    "a: no next step if a_result = 3. Add a step without a condition.",
  ]);
});

test("a value can be compared with another one", () => {
  const { doc, s2 } = comparing(all());
  const [flag, count, limit] = operandsOf(doc, TYPES, "b") as [Operand, Operand, Operand];
  expect(othersOf(count, [flag, count, limit])).toEqual([limit]);
  expect(othersOf(flag, [flag, count, limit])).toEqual([]);
  const pair = withOther(compared(N, ">=", "3"), count, limit);
  expect(pair).toEqual({ what: N, operator: ">=", value: "", other: "par" });
  expect(withOther(compared(N, "[)", "3", "7"), count, limit).operator).toBe("==");
  expect(operatorsOf(count, { ...limit, type: "double" })).toEqual(["<", "<=", ">", ">="]);
  expect(operatorsOf(flag, flag)).toEqual(["==", "!="]);
  expect(withOperator(pair, "<")).toEqual({ ...pair, operator: "<" });
  expect(withOther(pair, count, undefined)).toEqual(compared(N, ">=", "0"));
  expect(fieldsOf(doc, TYPES, all({ ...pair, operator: "==" }))).toEqual({ when: all({ ...pair, operator: "==" }) });
  expect(comparisonWords(doc, TYPES, pair)).toBe("a_result ≥ so_many");
  s2.when = all(pair);
  expect(usersOf(doc, TYPES, { parameter: "par" })).toEqual([s2.id]);
  s2.when = all({ ...pair, other: "gone" });
  expect(problemsOf(doc, TYPES).map((each) => each.id)).toContain(s2.id);
});
