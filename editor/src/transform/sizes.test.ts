import { describe, expect, it } from "vitest";
import type { ObjectModel } from "../protocol/types";
import { ORIGIN } from "../viewmodel/frames";
import { fromAngles } from "./placing";
import { halfOf, lifted, measures, pulled, THINNEST } from "./sizes";

const BOX: ObjectModel = { type: "Box", box: { id: "b", size_x: 0.2, size_y: 0.4, size_z: 0.1 } };
const CYLINDER: ObjectModel = { type: "Cylinder", cylinder: { id: "c", radius: 0.05, height: 0.3 } };
const UP = { x: 0, y: 0, z: 1 };

describe("dragging a face", () => {
  it("keeps the opposite face and moves the centre by half the distance", () => {
    const { model, shift } = pulled(BOX, "y", 0.1);
    expect(model.box?.size_y).toBeCloseTo(0.5, 12);
    expect(shift).toBeCloseTo(0.05, 12);
    expect(model.box?.size_x).toBe(0.2);
  });

  it("stops at the smallest size", () => {
    const { model, shift } = pulled(BOX, "z", -3);
    expect(model.box?.size_z).toBe(THINNEST);
    expect(shift).toBeCloseTo((THINNEST - 0.1) / 2, 12);
  });

  it("of round shapes changes the size about the axis", () => {
    expect(pulled(CYLINDER, "x", 0.01)).toMatchObject({
      model: { cylinder: { radius: 0.060000000000000005, height: 0.3 } },
      shift: 0,
    });
    expect(pulled(CYLINDER, "z", 0.1).shift).toBeCloseTo(0.05, 12);
  });
});

it("each dimension can be typed and changes one size", () => {
  expect(measures(BOX).map((each) => [each.label, each.value])).toEqual([
    ["X", 0.2],
    ["Y", 0.4],
    ["Z", 0.1],
  ]);
  expect(measures(CYLINDER)[1]?.put(0.5).cylinder).toEqual({ id: "c", radius: 0.05, height: 0.5 });
  expect(halfOf(CYLINDER)).toEqual({ x: 0.05, y: 0.05, z: 0.15 });
});

it("an item placed on a surface touches it, also if it is rotated", () => {
  const at = { x: 1, y: 2, z: 0.5 };
  expect(lifted(at, UP, { pose: ORIGIN, model: BOX }).z).toBeCloseTo(0.55, 12);
  const lying = { ...ORIGIN, orientation: fromAngles({ x: Math.PI / 2, y: 0, z: 0 }) };
  expect(lifted(at, UP, { pose: lying, model: BOX }).z).toBeCloseTo(0.7, 12);
  expect(lifted(at, UP, { pose: lying, model: CYLINDER }).z).toBeCloseTo(0.55, 12);
  expect(lifted(at, UP, { pose: ORIGIN })).toEqual(at);
});
