/** Candidates at the crosshair, and the direction to items outside the view. */

import { Box3, Matrix4, PerspectiveCamera, Ray, Vector3 } from "three";
import { expect, test } from "vitest";
import { aimed, middle, type Target } from "./aiming";
import { bearing } from "./bearing";

/** From 1 m above, straight down. */
const RAY = new Ray(new Vector3(0, 0, 1), new Vector3(0, 0, -1));
const CONE = 0.06;
const ball = (id: string, x: number, z = 0, radius = 0.015): Target => ({ id, centre: new Vector3(x, 0, z), radius });
const box = (id: string, size: [number, number, number], place: [number, number, number], turned = 0): Target => {
  const half = new Vector3(...size).multiplyScalar(0.5);
  return {
    id,
    box: new Box3(half.clone().negate(), half),
    frame: new Matrix4().makeRotationZ(turned).setPosition(...place),
  };
};
const ids = (targets: Target[], before = "") => aimed(targets, RAY, CONE, before).map((each) => each.id);

test("a small item near the crosshair precedes the table behind it, one at the edge of the cone follows it", () => {
  const table = box("table", [2, 2, 0.1], [0, 0, -0.05]);
  expect(ids([table, ball("near", 0.03)])).toEqual(["near", "table"]);
  expect(ids([table, ball("edge", 0.07)])).toEqual(["table", "edge"]);
  expect(ids([table, ball("out", 0.2)])).toEqual(["table"]);
});

test("occluded items are candidates too, after an equal one in front", () => {
  const wall = box("wall", [2, 2, 0.02], [0, 0, 0.6]);
  expect(ids([wall, ball("behind", 0)])).toEqual(["behind", "wall"]);
  expect(ids([ball("low", 0, -1), ball("high", 0, 0.5)])).toEqual(["high", "low"]);
});

test("the angle is that of the closest point of the closest part, also for a rotated box", () => {
  // A corner 0.03 m from the ray, at a distance of 1 m.
  const [turned] = aimed([box("turned", [0.1, 0.1, 0.001], [0.03 + 0.05 * Math.SQRT2, 0, 0], Math.PI / 4)], RAY, CONE);
  expect(turned?.off).toBeCloseTo(Math.atan(0.03), 3);
  expect(ids([box("far off", [0.1, 0.1, 0.1], [0.2, 0, 0])])).toEqual([]);
  const arm = [box("arm", [0.1, 0.1, 0.1], [5, 0, 0]), box("arm", [0.1, 0.1, 0.1], [0, 0, 0])];
  expect(aimed(arm, RAY, CONE)).toMatchObject([{ id: "arm", off: 0 }]);
  expect(aimed(arm, RAY, CONE)).toHaveLength(1);
});

test("items behind the camera are left out, the previous best wins ties, and the list is limited", () => {
  expect(ids([ball("behind me", 0, 3), box("too", [0.1, 0.1, 0.1], [0, 0, 2])])).toEqual([]);
  const two = [ball("a", 0.02), ball("b", -0.0201)];
  expect(ids(two)).toEqual(["a", "b"]);
  expect(ids(two, "b")).toEqual(["b", "a"]);
  expect(ids(Array.from({ length: 40 }, (_, n) => ball(`${n}`, n / 1000))).length).toBe(8);
});

function camera(): PerspectiveCamera {
  const made = new PerspectiveCamera(50, 2, 0.01, 100);
  made.up.set(0, 0, 1);
  made.lookAt(1, 0, 0); // from the origin along x: y is to the left
  return made;
}

test("the cone has the width of its pixels", () => {
  const { ray, cone } = middle(camera(), 800, 400);
  expect(cone).toBeCloseTo((25 * Math.PI) / 180);
  expect(ray.direction.x).toBeCloseTo(1);
});

test("an item outside the view has the direction in which to turn", () => {
  const seen = (x: number, y: number, z: number) => bearing(new Vector3(x, y, z), camera(), 800, 400);
  expect(seen(2, 0, 0)).toMatchObject({ inView: true, x: expect.closeTo(400), y: expect.closeTo(200) });
  expect(seen(1, 3, 0)).toMatchObject({ inView: false });
  expect(seen(1, 3, 0).x).toBeLessThan(0);
  expect(seen(-1, 1, 0)).toMatchObject({ inView: false, y: expect.closeTo(200) });
  expect(seen(-1, 1, 0).x).toBeLessThan(0);
  expect(seen(-1, -1, 0).x).toBeGreaterThan(800);
  expect(seen(-1, 0, 1).y).toBeLessThan(0); // above, and behind
  expect(seen(-1, 0, 0).inView).toBe(false);
});
