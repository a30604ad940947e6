import { expect, test } from "vitest";
import { atEdge } from "./edge";

test("the arrow is at the edge, in the direction of its item", () => {
  expect(atEdge({ x: 2000, y: 300 }, 800, 600, [])).toEqual({ x: 766, y: 300, angle: 0 });
  expect(atEdge({ x: 400, y: 4000 }, 800, 600, [])).toEqual({ x: 400, y: 566, angle: 90 });
  const { x, y, angle } = atEdge({ x: -800, y: -300 }, 800, 600, []);
  expect([x, y]).toEqual([34, 300 - 366 / 2]);
  expect(angle).toBeCloseTo(-180 + (Math.atan2(600, 1200) * 180) / Math.PI);
});

test("the arrow moves along the edge to avoid controls and stays in the view", () => {
  const stop = { left: 600, top: 250, right: 800, bottom: 350 };
  const beside = atEdge({ x: 2000, y: 310 }, 800, 600, [stop]);
  expect(beside.x).toBe(766);
  expect(beside.y).toBeGreaterThanOrEqual(372);
  expect(beside.y).toBeLessThan(395);
  expect(beside.angle).toBeCloseTo((Math.atan2(10, 1600) * 180) / Math.PI);
  const below = atEdge({ x: 2000, y: 310 }, 800, 600, [stop, { ...stop, top: 350, bottom: 600 }]);
  expect(below.y).toBeLessThanOrEqual(228);
  // If the whole edge is occupied, the arrow is further inside.
  expect(atEdge({ x: 400, y: 4000 }, 800, 600, [{ left: 0, top: 540, right: 800, bottom: 600 }])).toEqual({
    x: 400,
    y: 496,
    angle: 90,
  });
  // If everything is occupied, the arrow is still shown.
  expect(atEdge({ x: 2000, y: 300 }, 800, 600, [{ left: 0, top: 0, right: 800, bottom: 600 }])).toMatchObject({
    x: 766,
    y: 300,
  });
});
