import { Object3D } from "three";
import { expect, it, test } from "vitest";
import { type DeviceModel, modelOf } from "./models";

const made = (icon: string, lamps?: string[]): DeviceModel => modelOf(icon, lamps) as DeviceModel;
/** Return the model with an object for each moving part, as the view makes it. */
function drawn(icon: string): { model: DeviceModel; parts: Object3D[] } {
  const model = made(icon);
  for (const part of model.moving) part.object = new Object3D();
  model.step(Infinity);
  return { model, parts: model.moving.map(({ object }) => object as Object3D) };
}

it("devices have models of a few hundred triangles, unknown ones have none", () => {
  for (const icon of ["machine", "camera", "light", "printer", "reader", "io", "scale", "gripper", "suction", "axis"])
    expect((modelOf(icon)?.body.index?.count ?? Infinity) / 3, icon).toBeLessThan(800);
  expect(modelOf("service")).toBeNull();
  // The label of a station is above its nest, not above the open door.
  expect(modelOf("machine")?.top).toBeCloseTo(0.026);
});

test("the fingers of a gripper are as far apart as it reports", () => {
  const { model, parts } = drawn("gripper");
  model.show({ width: 0.05 });
  model.step(Infinity);
  expect(parts.map(({ position }) => position.y)).toEqual([0.025, -0.025]);
  expect(model.length).toBeCloseTo(0.15);
});

test("the door moves to the reported state in time, and then needs no frame", () => {
  const { model, parts } = drawn("machine");
  const lid = () => parts[0]?.rotation.x ?? NaN;
  expect(lid()).toBe(0); // open while nothing is reported
  model.show({ door: 0 });
  expect(model.step(0.1)).toBe(true);
  expect(lid()).toBeGreaterThan(0);
  expect(lid()).toBeLessThan(Math.PI / 2);
  for (let n = 0; n < 20; n++) model.step(0.1);
  expect(lid()).toBeCloseTo(Math.PI / 2);
  expect(model.step(0.1)).toBe(false);
  model.show({ door: 1 });
  model.step(Infinity); // at low quality at once
  expect(lid()).toBe(0);
});

test("a belt runs while it reports motion, and at low quality only looks so", () => {
  const { model, parts } = drawn("axis");
  const at = () => parts[0]?.position.x ?? NaN;
  const brightness = () => model.moving[0]?.geometry.getAttribute("color").getX(0) ?? NaN;
  const dark = brightness();
  expect(model.step(0.1)).toBe(false);
  model.show({ velocity: 0.25 });
  expect(brightness()).toBeGreaterThan(dark);
  model.step(Infinity);
  expect(at()).toBe(0);
  expect(model.step(0.1)).toBe(true);
  expect(at()).toBeCloseTo(0.025);
  model.show({ velocity: -0.25 });
  model.step(0.2);
  expect(at()).toBeCloseTo(0.075); // the marks repeat every 0.1 m
  model.show({ velocity: 0 });
  expect(model.step(0.1)).toBe(false);
});

test("a tower light has the lamps that are reported, in their colours when they are lit", () => {
  const model = made("light", ["green", "red"]);
  const colors = model.body.getAttribute("color");
  const reds = () => {
    let most = 0;
    for (let n = 0; n < colors.count; n++) most = Math.max(most, colors.getX(n) - colors.getY(n));
    return most;
  };
  const off = reds();
  model.show({ green: 0, red: 1 });
  expect(reds()).toBeGreaterThan(2 * off);
  expect(model.fits({ green: 1, red: 0 })).toBe(true);
  expect(model.fits({ green: 1, red: 0, blue: 0 })).toBe(false);
  expect(made("light", ["green"]).top).toBeLessThan(model.top);
});
