/** The program as a graph, with sequences folded. */

import { describe, expect, test } from "vitest";
import { foldedRuns, runsOf } from "../../program/runs";
import { program, TYPES } from "../../program/testing";
import { firstIn, graphOf, lastIn } from "./graph";

test("the graph goes from top to bottom, and offers the ways that are free", () => {
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
  expect(of("a")?.ways.map((each) => each.id)).toEqual(["false"]);
  expect(of("START")?.ways).toEqual([]);
  expect(of("c")?.ways.map((each) => each.id)).toEqual(["next"]);
  expect(lines.map((each) => [each.words, each.branch])).toEqual([
    ["", "always"],
    ["yes", "true"],
    ["", "always"],
  ]);
});

describe("straight runs", () => {
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

  test("end where ways part or meet, and are of three actions at least", () => {
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

  test("are one node with a count, which steps lead to and from as to and from its ends", () => {
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

  test("are open where something in them is to be seen", () => {
    expect(foldedRuns(doc, new Set(["b", "c", "d"]), new Set(["d"]))).toEqual([]);
    expect(foldedRuns(doc, new Set(), new Set())).toEqual([]);
  });
});
