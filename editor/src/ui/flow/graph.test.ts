/** The program as a graph, with sequences folded. */

import { describe, expect, test } from "vitest";
import { foldedRuns, runsOf } from "../../program/runs";
import { program, TYPES } from "../../program/testing";
import type { ObjectAction } from "../../protocol/types";
import { firstIn, graphOf, lastIn } from "./graph";

test("the graph is laid out from top to bottom and offers the free branches", () => {
  const doc = program({ a: "ask", b: "act", c: "act" }, [
    ["START", "a"],
    ["a", "b", "true"],
    ["b", "END"],
  ]);
  const { boxes, lines } = graphOf(doc, TYPES);
  const of = (id: string) => boxes.find((each) => each.id === id);
  const heights = ["START", "a", "b", "END"].map((id) => of(id)?.y ?? 0);
  expect(heights).toEqual([...heights].sort((one, other) => one - other));
  expect(new Set(heights).size).toBe(4);
  expect(of("a")?.branches.map((each) => each.id)).toEqual(["false"]);
  expect(of("START")?.branches).toEqual([]);
  expect(of("c")?.branches.map((each) => each.id)).toEqual(["next"]);
  expect(lines.map((each) => [each.words, each.branch])).toEqual([
    ["", "always"],
    ["yes", "true"],
    ["", "always"],
  ]);
});

test("nodes show the values of an action that its name and point do not tell", () => {
  const doc = program({ a: "count", b: "count", c: "act" }, [], {
    a: { type: "project_parameter", value: '"par"' },
    b: { type: "integer", value: "3" },
  });
  const types = { ...TYPES, actions: { Device: TYPES.actions.Device?.map(inPieces) ?? [] } };
  const { boxes } = graphOf(doc, types);
  const of = (id: string) => boxes.find((each) => each.id === id);
  expect([of("a")?.values, of("b")?.values, of("c")?.values]).toEqual(["by 5\u00a0pcs", "by 3\u00a0pcs", ""]);
  expect((of("b")?.height ?? 0) - (of("c")?.height ?? 0)).toBeGreaterThan(10);
});

function inPieces(action: ObjectAction): ObjectAction {
  const parameters = action.parameters.map((each) => ({ ...each, extra: '{"unit": "pcs"}' }));
  return { ...action, parameters };
}

describe("sequences", () => {
  const doc = program({ a: "ask", b: "act", c: "act", d: "act", e: "act", f: "act" }, [
    ["START", "a"],
    ["a", "b", "true"],
    ["b", "c"],
    ["c", "d"],
    ["d", "e"],
    ["a", "f", "false"],
    ["f", "e"],
    ["e", "END"],
  ]);

  test("have at least three actions and end at branches and joins", () => {
    expect(runsOf(doc)).toEqual([["b", "c", "d"]]);
    // A condition or a second predecessor ends a sequence.
    expect(
      runsOf(
        program({ a: "act", b: "ask", c: "act", d: "act" }, [
          ["a", "b"],
          ["b", "c", "true"],
          ["c", "d"],
        ]),
      ),
    ).toEqual([]);
    expect(runsOf(program({ a: "act", b: "act" }, [["a", "b"]]))).toEqual([]);
  });

  test("become one node with a count and the connections of their ends", () => {
    const folded = foldedRuns(doc, new Set(["c"]), new Set());
    const { boxes, lines } = graphOf(doc, TYPES, folded);
    const one = boxes.find((each) => each.kind === "fold");
    expect([one?.name, one?.detail]).toEqual(["3 actions", "b, c, d"]);
    expect(boxes.map((each) => each.id)).toEqual(["START", "a", "e", "f", "fold/b", "END"]);
    expect(lines.map((each) => [each.from, each.to])).toEqual([
      ["START", "a"],
      ["a", "fold/b"],
      ["fold/b", "e"],
      ["a", "f"],
      ["f", "e"],
      ["e", "END"],
    ]);
    expect(one && [firstIn(one), lastIn(one)]).toEqual(["b", "d"]);
  });

  test("are unfolded if one of their actions has to be visible", () => {
    expect(foldedRuns(doc, new Set(["b", "c", "d"]), new Set(["d"]))).toEqual([]);
    expect(foldedRuns(doc, new Set(), new Set())).toEqual([]);
  });
});
