import { expect, test } from "vitest";
import type { OpenDocument } from "../store/state";
import { alongZ, composed, fromRollPitchYaw, ORIGIN, relativeTo, rotated, turn, worldOf } from "./frames";
import { rollPitchYaw } from "./rotations";

const frame = { position: { x: 1, y: -2, z: 0.5 }, orientation: fromRollPitchYaw([20, -30, 110]) };
const pose = { position: { x: 0.1, y: 0.2, z: 0.3 }, orientation: fromRollPitchYaw([-5, 40, 77]) };

function close(a: object, b: object): void {
  for (const [key, value] of Object.entries(b))
    expect((a as Record<string, number>)[key]).toBeCloseTo(value as number, 9);
}

test("relativeTo is the inverse of composed", () => {
  const back = relativeTo(frame, composed(frame, pose));
  close(back.position, pose.position);
  close(back.orientation, pose.orientation);
});

test("roll, pitch and yaw are converted to a rotation and back", () => {
  const angles = rollPitchYaw(fromRollPitchYaw([12, -34, 156]));
  [12, -34, 156].forEach((wanted, n) => expect(angles[n]).toBeCloseTo(wanted, 6));
});

test("alongZ turns z to the given direction, also to the opposite one", () => {
  for (const direction of [
    { x: 0, y: 0, z: -1 },
    { x: 0.6, y: 0, z: 0.8 },
    { x: 0, y: 1, z: 0 },
  ]) {
    close(rotated({ x: 0, y: 0, z: 1 }, alongZ(direction, frame.orientation)), direction);
  }
});

test("the world pose of a nested point is composed of those of its parents", () => {
  const quarter = { position: { x: 1, y: 0, z: 0 }, orientation: turn({ x: 0, y: 0, z: 1 }, Math.PI / 2) };
  const doc = {
    objects: { o: { id: "o", name: "o", type: "T", pose: quarter, parameters: [] } },
    points: {
      p: { id: "p", name: "p", position: { x: 1, y: 0, z: 0 }, parent: "o" },
      q: { id: "q", name: "q", position: { x: 0, y: 1, z: 0 }, parent: "p" },
    },
    orientations: { r: { id: "r", name: "r", pointId: "q", orientation: ORIGIN.orientation } },
  } as unknown as OpenDocument;
  close(worldOf(doc, "q").position, { x: 0, y: 1, z: 0 });
  close(worldOf(doc, "r").orientation, quarter.orientation);
});
