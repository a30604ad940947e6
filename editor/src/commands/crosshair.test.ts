import { expect, test } from "vitest";
import { against } from "./crosshair";

test("the z axis of a tool on a surface is opposite to the normal", () => {
  for (const normal of [
    { x: 0, y: 0, z: 1 },
    { x: 1, y: 0, z: 0 },
    { x: 0, y: -0.6, z: 0.8 },
    { x: 0, y: 0, z: -1 },
  ]) {
    const { x, y, z, w } = against(normal);
    // The third column of the rotation's matrix.
    const axis = [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)];
    [normal.x, normal.y, normal.z].forEach((each, index) => expect(axis[index]).toBeCloseTo(-each, 9));
  }
});
