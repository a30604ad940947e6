import { Group, Object3D, Vector3 } from "three";
import type { URDFRobot } from "urdf-loader";
import { expect, it } from "vitest";
import { LIGHT } from "../palette";
import { setPose } from "../poses";
import { GhostRobot } from "./ghost";

const model = () => Object.assign(new Object3D(), { joints: {} }) as unknown as URDFRobot;
const turned = { x: 0, y: 0, z: Math.SQRT1_2, w: Math.SQRT1_2 };

it("the ghost is at the given pose, independent of the robot's base", () => {
  const host = new Group();
  const ghost = new GhostRobot(host);
  setPose(host, { position: { x: 1, y: 2, z: 0 }, orientation: turned });
  const at = { position: { x: 0.4, y: -0.2, z: 0.1 }, orientation: { x: 0, y: 0, z: 0, w: 1 } };
  const of = model();
  const base = () => host.children[0]?.children[0]?.localToWorld(new Vector3(0.5, 0, 0)).toArray();
  ghost.show({ joints: {}, possible: true, at }, of, LIGHT);
  host.updateMatrixWorld();
  expect(base()?.map((each) => Math.round(each * 1e6) / 1e6)).toEqual([0.9, -0.2, 0.1]);
  // Without a pose of its own it is at the robot.
  ghost.show({ joints: {}, possible: true }, of, LIGHT);
  host.updateMatrixWorld();
  expect(base()?.map((each) => Math.round(each * 1e6) / 1e6)).toEqual([1, 2.5, 0]);
  ghost.show(undefined, of, LIGHT);
  expect(host.children).toEqual([]);
  expect(ghost.joints).toBeNull();
});
