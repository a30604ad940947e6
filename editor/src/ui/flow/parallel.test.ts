import { describe, expect, it } from "vitest";
import { listingOf } from "../../program/listing";
import { problemsOf } from "../../program/problems";
import { program, TYPES } from "../../program/testing";
import { functionOf } from "../../store/scope";
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

  it("is one node with the names of its calls", () => {
    const { boxes } = graphOf(doc, TYPES);
    expect(boxes.map(({ id }) => id).sort()).toEqual(["END", "START", "both", "show"]);
    expect(boxes.find(({ id }) => id === "both")?.detail).toBe("one, two");
  });

  it("is one row of the list", () => {
    expect(listingOf(doc)).toEqual([
      { kind: "action", id: "both", depth: 0 },
      { kind: "action", id: "show", depth: 0 },
    ]);
  });

  it("causes no problems, and its calls have results", () => {
    expect(problemsOf(doc, TYPES)).toEqual([]);
  });
});
