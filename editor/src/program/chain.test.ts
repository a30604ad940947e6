import { expect, test } from "vitest";
import { insertion, pointFor, slotFor, slotsOf } from "./chain";
import { program, TYPES } from "./testing";

const IF = (value: string) => ({ what: "a/default/0", value });

test("the first action follows Start, and the next ones the last action", () => {
  const empty = program({});
  expect(slotFor(empty, TYPES, "")).toEqual({ after: "START" });
  expect(insertion(empty, { after: "START" })).toEqual({ to: "END" });
  const chain = program({ a: "act", b: "act" }, [
    ["START", "a"],
    ["a", "b"],
    ["b", "END"],
  ]);
  expect(slotFor(chain, TYPES, "")).toEqual({ after: "b" });
  expect(insertion(chain, { after: "b" })).toEqual({ redirect: "s2", to: "END" });
  // After the selected action, whose connection continues after the new one.
  expect(slotFor(chain, TYPES, "a")).toEqual({ after: "a" });
  expect(insertion(chain, { after: "a" })).toEqual({ redirect: "s1", to: "b" });
});

test("after an action with a boolean result that is followed, the other branch is free", () => {
  const last = program({ a: "ask" }, [
    ["START", "a"],
    ["a", "END"],
  ]);
  expect(slotFor(last, TYPES, "a")).toEqual({ after: "a" });
  const doc = program({ a: "ask", b: "act" }, [
    ["START", "a"],
    ["a", "b"],
    ["b", "END"],
  ]);
  const no = { after: "a", condition: IF("false") };
  expect(slotFor(doc, TYPES, "a")).toEqual(no);
  expect(insertion(doc, no)).toEqual({ branch: { id: "s1", condition: IF("true") }, to: "END" });
  expect(slotsOf(doc, TYPES)).toEqual([
    { after: "START" },
    no,
    { after: "a", condition: IF("true") },
    { after: "a" },
    { after: "b" },
  ]);
  const both = program({ a: "ask", b: "act", c: "act" }, [
    ["a", "b", "true"],
    ["a", "c", "false"],
  ]);
  expect(insertion(both, no)).toEqual({ redirect: "s1", to: "c" });
  const one = program({ a: "ask", b: "act" }, [["a", "b", "true"]]);
  expect(slotFor(one, TYPES, "a")).toEqual(no);
  expect(insertion(one, no)).toEqual({ to: "END" });
});

test("actions in space go to the selected point, then to taught points without actions", () => {
  const doc = program({ a: "act" }, [["START", "a"]]);
  expect(pointFor(doc, "")).toBe("");
  expect(pointFor(doc, "a")).toBe("point");
  const joints = { id: "j", name: "j", robot_id: "r", joints: [], is_valid: true, pointId: "taught" };
  expect(pointFor({ ...doc, joints: { j: joints } }, "a")).toBe("taught");
  expect(pointFor({ ...doc, joints: { j: joints } }, "point")).toBe("point");
});
