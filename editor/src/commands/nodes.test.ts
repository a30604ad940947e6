import { expect, test } from "vitest";
import type { NodesData } from "../protocol/types";
import { objectsByNode } from "./nodes";

test("the cell file overrides the nodes of a scene", () => {
  const nodes: NodesData = { configured: true, nodes: [], assigned: { arm: "press" } };
  const objects = [
    { id: "1", name: "arm", type: "T", parameters: [], node: "oven" },
    { id: "2", name: "belt", type: "T", parameters: [], node: "press" },
    { id: "3", name: "lamp", type: "T", parameters: [], node: "saw" },
    { id: "4", name: "table", type: "T", parameters: [] },
  ];
  expect(objectsByNode(nodes, objects)).toEqual({ press: ["arm", "belt"], saw: ["lamp"] });
  expect(objectsByNode(null, objects)).toEqual({ oven: ["arm"], press: ["belt"], saw: ["lamp"] });
});
