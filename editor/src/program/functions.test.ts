import { describe, expect, it } from "vitest";
import type { ProjectFunction, ServerEvent } from "../protocol/types";
import { documentAfter } from "../store/document";
import { anyAction, functionOf, inScope, pathTo, scopeOf } from "../store/scope";
import { initialState, type OpenDocument, type State } from "../store/state";
import {
  callsOf,
  detailOf,
  freeResults,
  onAllPaths,
  picked,
  recursive,
  suggestedName,
  usersOfParameter,
} from "./functions";
import { metaOf } from "./logic";
import { actionNames, outputNames, resultNames } from "./naming";
import { doingWords, innermost } from "./position";
import { problemsOf } from "./problems";
import { program, TYPES } from "./testing";

/** A function with the parameter `amount` that returns whether it is fine; a call of it. */
const HANDLE: ProjectFunction = {
  id: "pfu",
  name: "handle",
  parameters: [{ name: "amount", type: "integer", value: "" }],
  returns: [{ type: "boolean", link: "look/default/0" }],
  actions: [
    {
      ...{ id: "feed", name: "feed", type: "device/count", flows: [{ type: "default", outputs: ["fed"] }] },
      parameters: [{ name: "by", type: "function_parameter", value: '"amount"' }],
    },
    {
      ...{ id: "look", name: "look", type: "device/ask", parameters: [] },
      flows: [{ type: "default", outputs: ["fine"] }],
    },
  ],
  logic: [
    { id: "l1", start: "START", end: "feed" },
    { id: "l2", start: "feed", end: "look" },
    { id: "l3", start: "look", end: "END" },
  ],
};

function withFunction(more: Partial<ProjectFunction> = {}): OpenDocument {
  const doc = program({ a: "act", call: "act", z: "act" }, [
    ["START", "a"],
    ["a", "call"],
    ["call", "z"],
    ["z", "END"],
  ]);
  const call = {
    ...(doc.actions.call as OpenDocument["actions"][string]),
    type: "pfu/call",
    parameters: [{ name: "amount", type: "integer", value: "3" }],
    flows: [{ type: "default" as const, outputs: ["fine"] }],
  };
  const actions = { ...doc.actions, call };
  return {
    ...doc,
    actions,
    program: { ...doc.program, actions },
    functions: { pfu: functionOf({ ...HANDLE, ...more }) },
  };
}

const event = (change_type: string, data: ProjectFunction) =>
  ({ event: "FunctionChanged", change_type, data }) as ServerEvent;

describe("the open function", () => {
  it("replaces the program in the document, and restores it when it is closed", () => {
    const doc = withFunction();
    const open = inScope(doc, ["pfu"]);
    expect(Object.keys(open.actions)).toEqual(["feed", "look"]);
    expect(scopeOf(open)).toBe("pfu");
    expect(open.actions.feed?.pointId).toBe("point"); // shown at the call
    const back = inScope(open, []);
    expect(back.actions).toBe(doc.actions);
    expect(back.logic).toBe(doc.logic);
  });

  it("follows the changes of others, and closes when the function is removed", () => {
    const open = inScope(withFunction(), ["pfu"]);
    const renamed = documentAfter(open, event("update", { ...HANDLE, name: "treat" }));
    expect(renamed.functions.pfu?.name).toBe("treat");
    expect(Object.keys(renamed.actions)).toEqual(["feed", "look"]);
    const elsewhere = { ...(open.program.actions.a as OpenDocument["actions"][string]), name: "other" };
    const moved = documentAfter(open, {
      event: "ActionChanged",
      change_type: "update",
      parent_id: "point",
      data: elsewhere,
    } as ServerEvent);
    expect(Object.keys(moved.actions)).toEqual(["feed", "look"]);
    expect(moved.program.actions.a?.name).toBe("other");
    const closed = documentAfter(open, event("remove", HANDLE));
    expect(closed.path).toEqual([]);
    expect(Object.keys(closed.actions)).toEqual(["a", "call", "z"]);
  });

  it("keeps its actions while nothing about them changes", () => {
    const open = inScope(withFunction(), ["pfu"]);
    const later = documentAfter(open, { event: "ProjectSaved" } as ServerEvent);
    expect(later.actions.feed).toBe(open.actions.feed);
  });

  it("is found by its items", () => {
    const doc = withFunction();
    expect(pathTo(doc, "feed")).toEqual(["pfu"]);
    expect(pathTo(doc, "l2")).toEqual(["pfu"]);
    expect(pathTo(inScope(doc, ["pfu"]), "a")).toEqual([]);
    expect(pathTo(doc, "unknown")).toBeUndefined();
    expect(anyAction(doc, "look")?.name).toBe("look");
  });
});

describe("calls", () => {
  it("take the parameters of the function with the range of their first use", () => {
    const doc = withFunction();
    const types = {
      ...TYPES,
      actions: {
        Device: (TYPES.actions.Device ?? []).map((each) => ({
          ...each,
          parameters: each.parameters.map((one) => ({ ...one, extra: '{"maximum": 9}' })),
        })),
      },
    };
    const meta = metaOf(types, doc, { type: "pfu/call" });
    expect(meta?.parameters).toEqual([
      { name: "amount", type: "integer", dynamic_value: false, extra: '{"maximum": 9}' },
    ]);
    expect(meta?.returns).toEqual(["boolean"]);
    expect(metaOf(types, doc, { type: "pfu/call" })).toBe(meta);
  });

  it("are listed, named and described", () => {
    const doc = withFunction();
    expect(callsOf(doc, "pfu").map((each) => each.action.id)).toEqual(["call"]);
    expect(detailOf(doc, doc.actions.call as never)).toBe("function handle");
    expect(resultNames(doc, doc.functions.pfu as never)).toEqual(["fine_2"]);
    expect(actionNames(doc)).toEqual(["a", "call", "z", "feed", "look"]);
    expect(outputNames(inScope(doc, ["pfu"]))).toEqual(["amount", "fed", "fine"]);
    expect(usersOfParameter(doc.functions.pfu as never, "amount").map((each) => each.id)).toEqual(["feed"]);
  });

  it("cannot be recursive", () => {
    const doc = withFunction();
    expect(recursive(doc, "pfu")).toBe(false);
    expect(recursive(inScope(doc, ["pfu"]), "pfu")).toBe(true);
  });
});

describe("selecting a run of actions", () => {
  const doc = program({ a: "ask", b: "act", c: "act", d: "act", e: "act" }, [
    ["START", "a"],
    ["a", "b", "true"],
    ["a", "c", "false"],
    ["b", "d"],
    ["c", "d"],
    ["d", "e"],
    ["e", "END"],
  ]);

  it("adds the actions between the first and the last one, in any order", () => {
    expect(picked(doc, [], "a")).toEqual(["a"]);
    expect(picked(doc, ["a"], "d")).toEqual(["a", "b", "c", "d"]);
    expect(picked(doc, ["d"], "a")).toEqual(["a", "b", "c", "d"]);
    expect(picked(doc, ["b"], "e")).toEqual(["b", "d", "e"]);
    expect(picked(doc, ["b", "d", "e"], "e")).toEqual(["b", "d"]);
  });

  it("suggests a name from the first and the last one", () => {
    expect(suggestedName(doc, ["b", "d", "e"])).toBe("do_b_to_e");
    expect(suggestedName(doc, ["d"])).toBe("do_d");
  });
});

describe("results", () => {
  it("come from actions that run on all paths", () => {
    const doc = withFunction();
    const open = inScope(doc, ["pfu"]);
    expect(onAllPaths(open, "look")).toBe(true);
    expect(freeResults(doc, doc.functions.pfu as never).map((each) => each.name)).toEqual(["fed"]);
    const around = withFunction({
      logic: [
        ...HANDLE.logic.slice(0, 2),
        { id: "l3", start: "look", end: "END" },
        { id: "l4", start: "feed", end: "END", error_kinds: ["refused"] },
      ],
    });
    expect(onAllPaths(inScope(around, ["pfu"]), "look")).toBe(false);
    expect(problemsOf(around, TYPES).map((each) => [each.scope, each.text])).toEqual([
      ["pfu", "handle: The result fine is missing if look does not run."],
    ]);
  });
});

describe("problems", () => {
  it("are found in functions, too", () => {
    expect(problemsOf(withFunction(), TYPES)).toEqual([]);
    const lacking = withFunction({ parameters: [] });
    expect(problemsOf(lacking, TYPES).map((each) => [each.scope, each.id, each.text])).toEqual([
      ["pfu", "feed", "handle: feed: the parameter of the function used for by no longer exists."],
    ]);
    const open = inScope(lacking, ["pfu"]);
    expect(problemsOf(open, TYPES)).toEqual(problemsOf(lacking, TYPES));
  });
});

describe("the running program", () => {
  const state = (running: string[], position: State["program"]["position"] = null): State => {
    const base = initialState();
    return { ...base, doc: withFunction(), program: { ...base.program, running, position } };
  };

  it("is inside of the function that the running call has called", () => {
    expect(innermost(state(["call", "feed"]))).toEqual(["feed"]);
    expect(doingWords(state(["call", "feed"]))).toBe("call › feed");
    expect(doingWords(state(["call"]))).toBe("call");
  });

  it("is where the server reports it", () => {
    const frames = [{ action_id: "call" }, { action_id: "feed", function_id: "pfu", call_action_id: "call" }];
    expect(doingWords(state(["feed"], { run: 1, branches: [{ id: "main", frames }] }))).toBe("call › feed");
  });
});
