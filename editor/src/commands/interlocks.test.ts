import { expect, test } from "vitest";
import type { Interlock } from "../protocol/types";
import { canBeZone, freeInterlockName, needFor } from "./interlocks";

test("a condition starts with a value of the type of its observation", () => {
  const observation = { description: "" };
  expect(needFor("obj", { ...observation, name: "door_open", type: "boolean" })).toEqual({
    object_id: "obj",
    observation: "door_open",
    operator: "==",
    value: "true",
    point: "",
  });
  expect(needFor("obj", { ...observation, name: "velocity", type: "double" })).toMatchObject({
    operator: "<=",
    value: "0",
  });
  const members = ['"auto"', '"manual"'];
  expect(needFor("obj", { ...observation, name: "mode", type: "string_enum", members })).toMatchObject({
    value: '"auto"',
  });
  expect(needFor("obj", { ...observation, name: "text", type: "string" })).toMatchObject({ value: '""' });
});

test("only bodies with a simple shape can be zones", () => {
  const type = {
    type: "T",
    description: "",
    built_in: false,
    base: "VirtualCollisionObject",
    has_pose: true,
    abstract: false,
    disabled: false,
  };
  const box = { id: "T", size_x: 1, size_y: 1, size_z: 1 };
  expect(canBeZone({ ...type, settings: [], object_model: { type: "Box", box } })).toBe(true);
  expect(canBeZone({ ...type, settings: [], object_model: { type: "Mesh", mesh: { id: "T", asset_id: "a" } } })).toBe(
    false,
  );
  expect(canBeZone({ ...type, base: "CollisionObject", settings: [], object_model: { type: "Box", box } })).toBe(false);
  expect(canBeZone(undefined)).toBe(false);
});

test("a new interlock gets a free name", () => {
  const known = [{ name: "Zone" }, { name: "Zone 2" }] as Interlock[];
  expect(freeInterlockName("Zone", known)).toBe("Zone 3");
  expect(freeInterlockName("Door", known)).toBe("Door");
});
