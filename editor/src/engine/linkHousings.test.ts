import { CylinderGeometry, Matrix4, Mesh, SphereGeometry, Vector3 } from "three";
import { expect, it } from "vitest";
import { linkGeometry } from "./linkHousings";

it("spheres on the axis of a joint become housings along it, others stay", () => {
  const sphere = (x: number) => ({
    mesh: new Mesh(new SphereGeometry(0.05)),
    matrix: new Matrix4().makeTranslation(x, 0, 0.1),
  });
  const axis = { through: new Vector3(), along: new Vector3(0, 0, 1) };
  const size = (x: number) => {
    const geometry = linkGeometry([sphere(x)], [axis]);
    geometry.computeBoundingBox();
    return geometry.boundingBox?.getSize(new Vector3()) ?? new Vector3();
  };
  expect(size(0).z).toBeCloseTo(0.126);
  expect(size(0).x).toBeCloseTo(0.108);
  expect(size(0.2).x).toBeCloseTo(0.1, 2);
  const arm = { mesh: new Mesh(new CylinderGeometry(0.05, 0.05, 0.4)), matrix: new Matrix4() };
  const whole = linkGeometry([arm, sphere(0), sphere(0)], [axis]);
  expect(whole.getAttribute("color").count).toBe(whole.getAttribute("position").count);
  expect((whole.index?.count ?? 0) / 3).toBeLessThan(500);
});
