import { Vector3 } from "three";
import { expect, test } from "vitest";
import { dragged } from "./useGoalGizmo";

const START = { position: { x: 0.1, y: 0.2, z: 0.3 }, orientation: { x: 1, y: 0, z: 0, w: 0 } };
const NO_WAY = new Vector3();

test("dragging a target along an axis keeps its orientation", () => {
  const goal = dragged(START, {
    handle: { kind: "axis", axis: "z" },
    translation: new Vector3(0, 0, 0.05),
    axis: new Vector3(0, 0, 1),
    angle: 0,
  });
  expect(goal.position.z).toBeCloseTo(0.35);
  expect(goal.orientation).toEqual(START.orientation);
});

test("turning a target with a ring keeps its position", () => {
  const { position, orientation } = dragged(START, {
    handle: { kind: "ring", axis: "z" },
    translation: NO_WAY,
    axis: new Vector3(0, 0, 1),
    angle: Math.PI / 2,
  });
  expect(position).toEqual(START.position);
  // Tool down, turned a quarter about the vertical: still down.
  expect(1 - 2 * (orientation.x ** 2 + orientation.y ** 2)).toBeCloseTo(-1);
  expect(Math.abs(orientation.x)).toBeCloseTo(Math.SQRT1_2);
});
