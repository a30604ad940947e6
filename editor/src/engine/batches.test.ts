/** Many small items in one mesh: their positions, and that they can be picked although they are not drawn. */

import {
  Color,
  Matrix4,
  type Mesh,
  MeshLambertMaterial,
  Object3D,
  Raycaster,
  Scene,
  SphereGeometry,
  Vector3,
} from "three";
import { expect, test } from "vitest";
import type { Instance } from "./baked";
import * as baked from "./baked";
import { Batches } from "./batches";

function instance(id: string, x: number, size = 1): Instance {
  const frame = new Object3D();
  frame.position.x = x;
  frame.updateMatrixWorld();
  return { id, frame, offset: new Matrix4().makeScale(size, size, size), color: new Color(1, 0.5, 0) };
}

function meshOf(scene: Scene): Mesh {
  const found = scene.children.filter((each) => each.visible);
  expect(found).toHaveLength(1);
  return found[0] as Mesh;
}

function hit(scene: Scene, x: number): string | undefined {
  const caster = new Raycaster(new Vector3(x, 0, 5), new Vector3(0, 0, -1));
  const [first] = caster.intersectObjects(scene.children, true);
  return first && (first.object.userData.batch as (index: number) => string)(first.instanceId as number);
}

test("spheres drawn as squares keep position and size and are picked as spheres", () => {
  const scene = new Scene();
  const batches = new Batches(scene, baked, () => {});
  const batch = batches.of("ball", () => [new SphereGeometry(0.1, 8, 6), new MeshLambertMaterial()], 0.1);
  const [one, other] = [instance("one", 1), instance("other", 2, 3)];
  batch.add(one);
  batch.add(other);
  batches.refresh();
  const { geometry } = meshOf(scene);
  expect(geometry.drawRange.count).toBe(2 * 6);
  expect([0, 4].map((n) => geometry.getAttribute("position").getX(n))).toEqual([1, 2]);
  expect(geometry.getAttribute("normal").getZ(0)).toBeCloseTo(0.1);
  expect(geometry.getAttribute("normal").getZ(4)).toBeCloseTo(0.3);
  expect(geometry.getAttribute("color").getY(7)).toBeCloseTo(0.5);
  expect([hit(scene, 1), hit(scene, 2.2), hit(scene, 1.2)]).toEqual(["one", "other", undefined]);
  batch.remove(one);
  batches.refresh();
  expect(meshOf(scene).geometry.drawRange.count).toBe(6);
  expect([hit(scene, 1), hit(scene, 2)]).toEqual([undefined, "other"]);
});

test("shapes are merged at their poses, also beyond the reserved space", () => {
  const scene = new Scene();
  const batches = new Batches(scene, baked, () => {});
  const shape = new SphereGeometry(0.1, 8, 6);
  const batch = batches.of("shape", () => [shape, new MeshLambertMaterial()]);
  batch.add(instance("0", 0));
  batches.refresh();
  for (let n = 1; n < 100; n++) batch.add(instance(String(n), n));
  batches.refresh();
  const { geometry } = meshOf(scene);
  const corners = shape.getAttribute("position").count;
  expect(geometry.drawRange.count).toBe(100 * (shape.index?.count ?? 0));
  const last = geometry.getAttribute("position").getX(99 * corners);
  expect(last).toBeCloseTo(99 + shape.getAttribute("position").getX(0));
  expect(Math.max(...(geometry.index?.array.slice(0, geometry.drawRange.count) ?? []))).toBeLessThan(100 * corners);
  expect(hit(scene, 99)).toBe("99");
});
