import { expect, test } from "vitest";
import type { ObjectTypeMeta, ObjectValuesData, SceneObject } from "../protocol/types";
import { initialState, type State } from "../store/state";
import { gripperOf, isPlaceable, partsOn, placeOf, toolOf } from "./devices";

const upright = { x: 0, y: 0, z: 0, w: 1 };
const pose = { position: { x: 1, y: 0, z: 0 }, orientation: upright };
const arm = { id: "obj_arm", name: "arm", type: "UR5e", pose } as SceneObject;
const tower = { id: "obj_tower", name: "tower", type: "TowerLight" } as SceneObject;
const claw = { id: "obj_claw", name: "claw", type: "Robotiq2F", parameters: [] } as unknown as SceneObject;

function stateWith(objects: SceneObject[], values: ObjectValuesData[] = []): State {
  const state = initialState();
  const type = (icon: string) => ({ icon, settings: [] }) as unknown as ObjectTypeMeta;
  const byName = { UR5e: type("robot"), TowerLight: type("light"), Robotiq2F: type("gripper") };
  const doc = { objects: Object.fromEntries(objects.map((each) => [each.id, each])) } as State["doc"];
  const live = { ...state.live, values: Object.fromEntries(values.map((each) => [each.object_id, each])) };
  return { ...state, doc, live, types: { ...state.types, byName, robots: { UR5e: {} } as never } };
}

test("a device without a pose is drawn where users put it", () => {
  const state = stateWith([arm, tower]);
  expect(placeOf(state, tower)).toBeUndefined();
  const placed = (value: unknown) => ({ ...state, view: { ...state.view, scene: { "place/obj_tower": value } } });
  expect(placeOf(placed(pose), tower)).toBe(pose);
  expect(placeOf(placed({ position: { x: 1 } }), tower)).toBeUndefined();
  expect(placeOf(placed(null), arm)).toBe(pose);
  expect([tower, arm, claw].map((each) => isPlaceable(state, each))).toEqual([true, false, false]);
});

test("a gripper is at its robot: the only one, or the one that its setting names", () => {
  expect(gripperOf(stateWith([arm, tower]), arm)).toBeUndefined();
  expect(gripperOf(stateWith([arm, claw]), arm)).toBe(claw);
  const other = { ...arm, id: "obj_other", name: "other" };
  expect(gripperOf(stateWith([arm, other, claw]), arm)).toBeUndefined();
  const named = { ...claw, parameters: [{ name: "robot", type: "string", value: '"other"' }] };
  expect(gripperOf(stateWith([arm, other, named]), other)).toBe(named);
  expect(gripperOf(stateWith([arm, other, named]), arm)).toBeUndefined();
});

test("the fingers follow the reported width, or the part that a gripper on an output holds", () => {
  const width = (...values: ObjectValuesData[]) => {
    const objects = values.some(({ object_id }) => object_id === claw.id) ? [arm, claw] : [arm];
    return toolOf(stateWith(objects, values), arm).tool?.values.width;
  };
  const own = (gripped: number, parts: ObjectValuesData["parts"] = []): ObjectValuesData => ({
    object_id: arm.id,
    values: { gripped },
    parts,
  });
  expect(width()).toBeUndefined();
  expect(width({ object_id: claw.id, values: { width: 0.03 }, parts: [] })).toBe(0.03);
  expect(width(own(0))).toBe(0.09);
  expect(width(own(1))).toBe(0);
  const model = { type: "Box", box: { id: "part", size_x: 0.08, size_y: 0.056, size_z: 0.001 } } as never;
  const held = own(1, [{ name: "part", link: "tcp", pose, model }]);
  expect(width(held)).toBe(0.056);
  expect(toolOf(stateWith([arm], [held]), arm).parts).toEqual([
    { link: "tcp", pose, shape: { kind: "box", size: [0.08, 0.056, 0.001] } },
  ]);
});

test("parts are drawn where sensors detect them", () => {
  const [position, size] = [
    { x: 0.2, y: 0, z: 0.06 },
    { x: 0.08, y: 0.06, z: 0.002 },
  ];
  const detected = (on: number, view: unknown = { on: "obj_belt", position, size }) => {
    const state = stateWith([], [{ object_id: "obj_io", values: { stop: on }, parts: [] }]);
    return partsOn({ ...state, view: { ...state.view, scene: { "part/obj_io/stop": view } } }, "obj_belt");
  };
  const sensor = "part/obj_io/stop";
  expect(detected(1)).toEqual([{ sensor, seen: true, position, size }]);
  expect(detected(0)).toEqual([{ sensor, seen: false, position, size }]);
  expect([detected(1, null), detected(1, { on: "obj_belt", size })]).toEqual([undefined, undefined]);
  expect(detected(1, { on: "obj_other", position, size })).toBeUndefined();
});
