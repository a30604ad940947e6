import { describe, expect, it } from "vitest";
import { slotsOf } from "../../program/chain";
import { laneIn, lanesOf, whyNotAtOnce } from "../../program/lanes";
import { listingOf } from "../../program/listing";
import { conditionActions, usable } from "../../program/logic";
import { callsIn } from "../../program/parallel";
import { problemsOf } from "../../program/problems";
import { program, TYPES } from "../../program/testing";
import type { Action } from "../../protocol/types";
import { functionOf } from "../../store/scope";
import { initialState, type OnPoint, type OpenFunction } from "../../store/state";
import { ItemMaker } from "../../viewmodel/items";
import { graphOf } from "./graph";

describe("parallel work", () => {
  const doc = program({ both: "act", one: "act", two: "act", show: "show" }, [
    ["START", "both"],
    ["both", "show"],
    ["show", "END"],
  ]);
  for (const id of ["one", "two"]) {
    const call = doc.actions[id];
    if (call) doc.actions[id] = { ...call, type: `pfu_${id}/call`, flows: [{ type: "default", outputs: [`r_${id}`] }] };
  }
  for (const id of ["one", "two"]) {
    doc.functions[`pfu_${id}`] = functionOf({
      ...{ id: `pfu_${id}`, name: id, parameters: [], returns: [{ type: "integer", link: `count_${id}/default/0` }] },
      actions: [
        {
          ...{ id: `count_${id}`, name: `count_${id}`, type: "device/count" },
          parameters: [{ name: "by", type: "integer", value: "1" }],
          flows: [{ type: "default", outputs: [`n_${id}`] }],
        },
      ],
      logic: [
        { id: `in_${id}`, start: "START", end: `count_${id}` },
        { id: `out_${id}`, start: `count_${id}`, end: "END" },
      ],
    });
  }
  const { both, show } = doc.actions;
  if (both) doc.actions.both = { ...both, type: "functions/parallel", branches: ["one", "two"] };
  if (show) doc.actions.show = { ...show, parameters: [{ name: "by", type: "link", value: '"one/default/0"' }] };

  it("is one node with its calls", () => {
    const { boxes } = graphOf(doc, TYPES);
    expect(boxes.map(({ id }) => id).sort()).toEqual(["END", "START", "both", "show"]);
    expect(boxes.find(({ id }) => id === "both")?.lanes?.map(({ id }) => id)).toEqual(["one", "two"]);
  });

  it("is one puck", () => {
    const ids = new ItemMaker().items({ ...initialState(), doc }).filter(({ kind }) => kind === "action");
    expect(ids.map(({ id }) => id)).toEqual(["both", "show", "START", "END"]);
  });

  it("is a row of the list with its indented calls", () => {
    expect(listingOf(doc)).toEqual([
      { kind: "action", id: "both", depth: 0 },
      { kind: "lane", id: "one", depth: 1 },
      { kind: "lane", id: "two", depth: 1 },
      { kind: "action", id: "show", depth: 0 },
    ]);
  });

  it("offers the results of its calls to what follows, not to each other", () => {
    const offered = (id: string) => usable(doc, TYPES, id, "integer").map(({ action }) => action.id);
    expect(offered("show")).toEqual(["one", "two"]);
    expect(offered("one")).toEqual([]);
    expect(conditionActions(doc, "both").map(({ id }) => id)).toEqual(["both", "one", "two"]);
    expect(slotsOf(doc, TYPES).map(({ after }) => after)).toEqual(["START", "both", "show"]);
  });

  it("must not use a device in two branches", () => {
    const why = "one and two both use device: count_one and count_two. A device can work for one branch only.";
    expect(problemsOf(doc, TYPES).map(({ id, text }) => [id, text])).toEqual([["both", `both: ${why}`]]);
    const [first, second] = callsIn(doc, { branches: ["one", "two"] });
    expect(whyNotAtOnce(doc, [first as never])).toBe("");
    const called = doc.functions.pfu_two as OpenFunction;
    const outer = functionOf({
      ...{ id: "pfu_outer", name: "outer", parameters: [], returns: [], logic: [] },
      actions: [{ id: "inner", name: "inner", type: "pfu_two/call", parameters: [], flows: [] }],
    });
    const nested = { ...doc, functions: { ...doc.functions, pfu_outer: outer } };
    const through = { name: "far", type: "pfu_outer/call" };
    expect(whyNotAtOnce(nested, [first as never, through])).toContain(
      "one and far both use device: count_one and count_two",
    );
    const other = {
      ...called,
      actions: { x: { ...(called.actions.count_two as OnPoint<Action>), type: "camera/look" } },
    };
    const apart = { ...doc, functions: { ...doc.functions, pfu_two: other } };
    expect(problemsOf(apart, TYPES).map(({ id }) => id)).not.toContain("both");
    expect(whyNotAtOnce(apart, [first as never, second as never])).toBe("");
    const parallel = {
      ...called,
      actions: { x: { ...(doc.actions.both as OnPoint<Action>), id: "x", name: "again" } },
    };
    const deep = { ...doc, functions: { ...doc.functions, pfu_two: parallel } };
    expect(whyNotAtOnce(deep, [first as never, second as never])).toBe("two contains other parallel work, again.");
  });

  it("shows what each branch does", () => {
    const frames = (call: string, action?: string) => [
      { action_id: "both" },
      { action_id: call, call_action_id: "both" },
      ...(action ? [{ action_id: action, function_id: `pfu_${call}`, call_action_id: call }] : []),
    ];
    const branches = [
      { id: "main", frames: [{ action_id: "both" }] },
      { id: "two", frames: frames("two") },
      { id: "one", frames: frames("one", "count_one") },
    ];
    const base = initialState();
    const state = { ...base, doc, program: { ...base.program, position: { run: 1, branches } } };
    expect(lanesOf(state)).toEqual([
      { id: "one", name: "one", actionId: "count_one", doing: "count_one" },
      { id: "two", name: "two", actionId: "two", doing: "" },
    ]);
    expect(lanesOf({ ...state, program: base.program })).toEqual([]);
    const entry = (number: number, action_id: string, call?: number) => ({
      ...{ run: 1, number, action_id, name: action_id, started: "" },
      ...(call !== undefined && { call }),
    });
    const trace = new Map(
      [entry(1, "both"), entry(2, "one", 1), entry(3, "count_one", 2)].map((each) => [each.number, each]),
    );
    expect([...trace.values()].map((each) => laneIn(doc, trace, each))).toEqual(["", "one", "one"]);
  });
});
