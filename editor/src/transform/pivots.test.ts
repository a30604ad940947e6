import { expect, it } from "vitest";
import type { ObjectModel } from "../protocol/types";
import { composed } from "../viewmodel/frames";
import { FLIPPED, pivotOffset } from "./pivots";

const box = { type: "Box", box: { id: "b", size_x: 0.1, size_y: 0.2, size_z: 0.3 } } satisfies ObjectModel;
/** Its z axis points down. */
const tool = { position: { x: 0.5, y: 0, z: 0.4 }, orientation: { x: 1, y: 0, z: 0, w: 0 } };

it.each([
  ["top", 0.25],
  ["middle", 0.4],
  ["bottom", 0.55],
] as const)("puts the %s of a box where the tool is", (pivot, height) => {
  const offset = pivotOffset(box, pivot);
  expect(typeof offset).toBe("number");
  const pose = composed(tool, { position: { x: 0, y: 0, z: -Number(offset) }, orientation: FLIPPED });
  expect(pose.position.z).toBeCloseTo(height);
  expect(Math.abs(pose.orientation.w)).toBeCloseTo(1); // upright
});

it("reports that a mesh has no top and no bottom", () => {
  expect(pivotOffset({ type: "Mesh" }, "top")).toContain("Use the middle");
  expect(pivotOffset(undefined, "middle")).toBe(0);
});
