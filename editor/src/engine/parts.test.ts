import { Group, type Mesh, MeshBasicMaterial } from "three";
import { expect, test } from "vitest";
import type { DetectedPart } from "./items";
import { Parts } from "./parts";

const SIZE = { x: 0.08, y: 0.06, z: 0.002 };
const at = (sensor: string, x: number, seen: boolean): DetectedPart => ({
  sensor,
  seen,
  position: { x, y: 0, z: 0 },
  size: SIZE,
});
const sensors = (coming: boolean, stop: boolean) => [at("stop", 0.26, stop), at("coming", 0.06, coming)];

function belt() {
  const root = new Group();
  const parts = new Parts(root, new MeshBasicMaterial());
  return { parts, drawn: () => root.children.map((each) => Number((each as Mesh).position.x.toFixed(3))) };
}

test("a part that leaves a sensor of a running belt glides to the next one and stays where it is detected", () => {
  const { parts, drawn } = belt();
  expect(parts.show(sensors(true, false), 0.2)).toBe(false);
  expect(drawn()).toEqual([0.06]);
  expect(parts.show(sensors(false, false), 0.2)).toBe(true);
  expect(parts.step(0.5)).toBe(true);
  expect(drawn()).toEqual([0.16]);
  // The belt stops: nothing moves, no frame is needed.
  expect(parts.show(sensors(false, false), 0)).toBe(false);
  expect(parts.step(0.5)).toBe(false);
  expect(drawn()).toEqual([0.16]);
  parts.show(sensors(false, false), 0.2);
  parts.step(9);
  expect(drawn()).toEqual([0.26]);
  expect(parts.show(sensors(false, true), 0.2)).toBe(false);
  expect(drawn()).toEqual([0.26]);
  // At the last sensor the part is taken away.
  parts.show(sensors(false, false), 0);
  expect(drawn()).toEqual([]);
});

test("a part that does not arrive disappears after a while, with the belt stopped after a shorter one", () => {
  const { parts, drawn } = belt();
  parts.show(sensors(true, false), 0.2);
  parts.show(sensors(false, false), 0.2);
  parts.step(1);
  parts.step(1);
  expect(drawn()).toEqual([0.26]);
  expect(parts.step(2)).toBe(false);
  expect(drawn()).toEqual([]);
  parts.show(sensors(true, false), 0);
  expect(parts.show(sensors(false, false), 0)).toBe(true);
  expect(drawn()).toEqual([0.06]);
  expect(parts.step(0.7)).toBe(false);
  expect(drawn()).toEqual([]);
});

test("a part waits at the sensor that it has left until the belt reports its speed", () => {
  const { parts, drawn } = belt();
  parts.show(sensors(true, false), 0);
  parts.show(sensors(false, false), 0);
  expect(parts.step(0.2)).toBe(true);
  expect(drawn()).toEqual([0.06]);
  expect(parts.show(sensors(false, false), 0.2)).toBe(true);
  parts.step(0.5);
  expect(drawn()).toEqual([0.16]);
  // A part that is taken from the last sensor disappears at once.
  parts.show(sensors(false, true), 0);
  expect(drawn()).toEqual([0.26]);
  parts.show(sensors(false, false), 0);
  expect(drawn()).toEqual([]);
});

test("without animation, parts are only drawn at sensors; a belt that runs back carries them back", () => {
  const { parts, drawn } = belt();
  parts.show(sensors(false, true), -0.1);
  parts.show(sensors(false, false), -0.1);
  parts.step(1);
  expect(drawn()).toEqual([0.16]);
  expect(parts.step(Infinity)).toBe(false);
  expect(drawn()).toEqual([]);
});
