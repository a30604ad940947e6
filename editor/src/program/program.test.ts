/** Free branches, usable results, problems and values of programs. */

import { describe, expect, test } from "vitest";
import type { LogicItem, Reach } from "../protocol/types";
import type { OpenDocument } from "../store/state";
import { cannotLead, conditionWords, freeStep, usable } from "./logic";
import { freeName, newOutputs } from "./naming";
import { problemsOf, usersOf } from "./problems";
import { reachOfAction } from "./reach";
import { program, TYPES } from "./testing";
import {
  doubleText,
  extraOf,
  initialValue,
  nameWithoutUnit,
  parseValue,
  rangeWords,
  textOf,
  withoutUnit,
} from "./values";

describe("steps", () => {
  test("the first next step is unconditional, a second one makes both conditional", () => {
    const doc = program({ a: "ask", b: "act", c: "act" }, [
      ["START", "a"],
      ["a", "b"],
    ]);
    expect(freeStep(doc, TYPES, "b")).toEqual({});
    const what = "a/default/0";
    expect(freeStep(doc, TYPES, "a")).toEqual({
      condition: { what, value: "false" },
      first: { item: doc.logic.s1, condition: { what, value: "true" } },
    });
    const both = program({ a: "ask", b: "act", c: "act" }, [
      ["a", "b", "true"],
      ["a", "c", "false"],
    ]);
    expect(freeStep(both, TYPES, "a")).toBe("a has no free branch.");
    expect(freeStep(doc, TYPES, "START")).toMatch("one first action");
  });

  test("unused numbers are offered, and the unconditional step stays the default", () => {
    const doc = program({ a: "count", b: "act", c: "act", d: "act" }, [
      ["a", "b"],
      ["a", "c", "0"],
    ]);
    expect(freeStep(doc, TYPES, "a")).toEqual({ condition: { what: "a/default/0", value: "1" } });
    expect(conditionWords(doc, TYPES, doc.logic.s0 as LogicItem)).toBe("else");
    expect(conditionWords(doc, TYPES, doc.logic.s1 as LogicItem)).toBe("a_result = 0");
    const plain = program({ a: "act", b: "act", c: "act" }, [["a", "b"]]);
    expect(freeStep(plain, TYPES, "a")).toMatch("no result to branch on");
  });

  test("connections that the server would refuse have a reason", () => {
    const doc = program({ a: "act", b: "act", c: "act" }, [
      ["a", "b"],
      ["b", "c"],
    ]);
    expect(cannotLead(doc, "c", "a")).toBe("This connection would create a loop.");
    expect(cannotLead(doc, "a", "b")).toBe("These steps are already connected.");
    expect(cannotLead(doc, "a", "b", "s0")).toBe("");
    expect(cannotLead(doc, "START", "END")).not.toBe("");
    expect(cannotLead(doc, "a", "START")).not.toBe("");
    expect(cannotLead(doc, "a", "c")).toBe("");
  });

  test("only results of earlier actions are offered", () => {
    const doc = program({ a: "count", b: "count", c: "count", d: "count" }, [
      ["a", "b"],
      ["b", "c"],
    ]);
    expect(usable(doc, TYPES, "b", "integer").map((each) => each.name)).toEqual(["a_result"]);
    expect(usable(doc, TYPES, "c", "integer").map((each) => each.name)).toEqual(["a_result", "b_result"]);
    expect(usable(doc, TYPES, "c", "boolean")).toEqual([]);
    // An unconnected action can be connected anywhere.
    expect(usable(doc, TYPES, "d", "integer")).toHaveLength(3);
  });
});

describe("problems", () => {
  const texts = (doc: OpenDocument) => problemsOf(doc, TYPES).map((each) => `${each.level} ${each.id}: ${each.text}`);

  test("a valid program has none", () => {
    expect(
      texts(
        program({ a: "ask", b: "act" }, [
          ["START", "a"],
          ["a", "b", "true"],
          ["a", "END", "false"],
          ["b", "END"],
        ]),
      ),
    ).toEqual([]);
    expect(
      texts(
        program(
          { a: "count" },
          [
            ["START", "a"],
            ["a", "END"],
          ],
          { a: { type: "project_parameter", value: '"par"' } },
        ),
      ),
    ).toEqual([]);
  });

  test("dead ends, incomplete branches and unreachable actions are reported at their items", () => {
    expect(texts(program({ a: "act" }))).toEqual([
      "error START: Start has no next step. Connect it to the first action.",
      "warn a: a is never run: no step leads to it.",
    ]);
    expect(texts(program({ a: "act" }, [["START", "a"]]))).toContain(
      "error a: a has no next step. Connect it to an action or to End.",
    );
    expect(
      texts(
        program({ a: "ask" }, [
          ["START", "a"],
          ["a", "END", "true"],
        ]),
      ),
    ).toEqual(["error a: a: no next step if a_result is no."]);
    expect(
      texts(
        program({ a: "count" }, [
          ["START", "a"],
          ["a", "END", "3"],
        ]),
      ),
    ).toEqual(["error a: a: no next step if none of the conditions is met."]);
  });

  test("missing values and results of later actions are reported", () => {
    const gone = program(
      { a: "count" },
      [
        ["START", "a"],
        ["a", "END"],
      ],
      { a: { type: "project_parameter", value: '"away"' } },
    );
    expect(texts(gone)).toEqual(["error a: a: the variable used for by no longer exists."]);
    const later = program(
      { a: "count", b: "count" },
      [
        ["START", "a"],
        ["a", "b"],
        ["b", "END"],
      ],
      { a: { type: "link", value: '"b/default/0"' } },
    );
    expect(texts(later)).toEqual(["error a: a: by uses a result of b, which does not run before it on all paths."]);
    expect(usersOf(later, TYPES, { action: "b" })).toEqual(["a"]);
    expect(usersOf(gone, TYPES, { parameter: "away" })).toEqual(["a"]);
  });
});

describe("values", () => {
  test("a double keeps its decimal point, limits are checked, and invalid numbers are reported", () => {
    expect(parseValue("double", "1")).toEqual({ json: "1.0" });
    expect(parseValue("double", "0,5")).toEqual({ json: "0.5" });
    expect(doubleText(1e21)).toBe("1e+21");
    expect(parseValue("integer", "1.5")).toEqual({ problem: "Enter a whole number." });
    expect(parseValue("integer", "9", { maximum: 8 })).toEqual({ problem: "At most 8." });
    expect(parseValue("integer", "")).toEqual({ problem: "Enter a number." });
    expect(parseValue("string", ' "x" ')).toEqual({ json: JSON.stringify(' "x" ') });
    expect(textOf("string", JSON.stringify(' "x" '))).toBe(' "x" ');
    const speed = extraOf({ extra: '{"minimum":0,"maximum":2,"unit":"m/s"}' });
    expect(rangeWords("double", speed)).toBe("0 to 2000 mm/s");
    expect(textOf("double", "0.25", speed)).toBe("250");
    expect(parseValue("double", "250", speed)).toEqual({ json: "0.25" });
    expect(parseValue("double", "2001", speed)).toEqual({ problem: "At most 2000." });
    expect(withoutUnit("highest speed, m/s; the arm slows down", "double", speed)).toBe(
      "highest speed; the arm slows down",
    );
    const ratio = { minimum: 0, maximum: 1 };
    expect([textOf("double", "0.29", ratio), rangeWords("double", ratio)]).toEqual(["29", "0 to 100 %"]);
    expect(rangeWords("double", { minimum: 0.01, maximum: 1 })).toBe("1 to 100 %");
    const period = { unit: "ms", minimum: 200, maximum: 1000 };
    expect([textOf("integer", "800", period), rangeWords("integer", period)]).toEqual(["0.8", "0.2 to 1 s"]);
    expect(parseValue("integer", "0,25", period)).toEqual({ json: "250" });
    expect(parseValue("integer", "0.2505", period)).toEqual({ problem: "Enter a multiple of 0.001." });
    expect([nameWithoutUnit("heartbeat_ms", period), nameWithoutUnit("items", {})]).toEqual(["heartbeat", "items"]);
    expect(withoutUnit("time until the drive stops, ms; 0: never", "integer", period)).toBe(
      "time until the drive stops; 0: never",
    );
    expect(textOf("double", "1.5707963267948966", { unit: "rad" })).toBe("90");
    expect(parseValue("double", "90", { unit: "rad" })).toEqual({ json: "1.5707963267949" });
    expect(textOf("integer", "2000", { unit: "ms" })).toBe("2");
    expect(extraOf({ extra: "no json" })).toEqual({});
  });

  test("the default of a number is the smallest allowed value", () => {
    const of = (type: string, extra?: object) =>
      initialValue({ name: "x", type, dynamic_value: false, ...(extra ? { extra: JSON.stringify(extra) } : {}) });
    expect([of("integer", { minimum: 3 }), of("double", { maximum: -2 }), of("boolean"), of("string")]).toEqual([
      "3",
      "-2.0",
      "false",
      '""',
    ]);
    expect(of("string_enum", { allowed_values: ["firm", "soft"] })).toBe('"firm"');
    expect(of("pose")).toBeUndefined();
  });

  test("free names", () => {
    expect(freeName("move", ["move", "move_2"])).toBe("move_3");
    expect(newOutputs(program({ ask: "ask" }), "ask", 2)).toEqual(["ask_result_1", "ask_result_2"]);
    expect(newOutputs(program({ ask: "ask" }), "ask", 1)).toEqual(["ask_result_2"]);
  });
});

describe("reachability of an action", () => {
  const action = (...parameters: [string, string][]) => ({
    type: "ur/move",
    parameters: parameters.map(([type, id], n) => ({ name: `p${n}`, type, value: JSON.stringify(id) })),
  });
  const reachability = (robot_id: string, end_effector_id: string, ...items: [string, Reach, string?][]) => ({
    [`${robot_id}//${end_effector_id}`]: {
      robot_id,
      end_effector_id,
      revision: 1,
      items: items.map(([id, reach, reason]) => ({ id, reach, ...(reason ? { reason } : {}) })),
    },
  });

  test("is that of the best end effector for each target, and of the worst target", () => {
    const reach = {
      ...reachability("ur", "grip", ["a", "out_of_reach", "too far"], ["b", "in_collision", "table"]),
      ...reachability("ur", "cup", ["a", "reachable"], ["b", "out_of_reach", "too far"]),
    };
    expect(reachOfAction(action(["pose", "a"]), reach)?.reach).toBe("reachable");
    expect(reachOfAction(action(["pose", "a"], ["joints", "b"]), reach)).toEqual({
      reach: "in_collision",
      reason: "table",
      goal: "b",
    });
  });

  test("ignores other robots, and items that are unknown or no targets", () => {
    const reach = reachability("other", "grip", ["a", "out_of_reach"]);
    expect(reachOfAction(action(["pose", "a"]), reach)).toBeNull();
    expect(reachOfAction(action(["position", "a"]), reachability("ur", "grip", ["a", "reachable"]))).toBeNull();
    expect(reachOfAction(action(["pose", "z"]), reachability("ur", "grip", ["a", "reachable"]))).toBeNull();
  });
});
