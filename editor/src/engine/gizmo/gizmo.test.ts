import { Quaternion, Ray, Vector3 } from "three";
import { describe, expect, it } from "vitest";
import { alongAxis, angleBetween, onPlane, toSegment, unwound } from "./drags";
import { distanceToOutline, handlesOf, keyOf, outline } from "./handles";

const HALF = { x: 1, y: 1, z: 1 };

describe("a pointer's ray", () => {
  it("returns the position along an axis, exactly if it meets the axis", () => {
    const target = new Vector3(0.3, 0, 0);
    const eye = new Vector3(1, -2, 1.5);
    const ray = new Ray(eye, target.clone().sub(eye).normalize());
    expect(alongAxis(ray, new Vector3(), new Vector3(1, 0, 0))).toBeCloseTo(0.3, 9);
  });

  it("returns nothing along an axis that points at the camera", () => {
    const ray = new Ray(new Vector3(0, 0, 5), new Vector3(0, 0, -1));
    expect(alongAxis(ray, new Vector3(), new Vector3(0, 0, 1))).toBeNull();
  });

  it("meets a plane in front, but not one behind or seen edge-on", () => {
    const down = new Ray(new Vector3(0.2, 0.1, 1), new Vector3(0, 0, -1));
    expect(onPlane(down, new Vector3(0, 0, 0.4), new Vector3(0, 0, 1))).toEqual(new Vector3(0.2, 0.1, 0.4));
    expect(onPlane(down, new Vector3(0, 0, 2), new Vector3(0, 0, 1))).toBeNull();
    expect(onPlane(down, new Vector3(), new Vector3(1, 0, 0))).toBeNull();
  });
});

describe("turning", () => {
  it("continues past half a turn in both directions", () => {
    const axis = new Vector3(0, 0, 1);
    const start = new Vector3(1, 0, 0.5);
    let last = 0;
    for (let degrees = 0; degrees <= 540; degrees += 20) {
      const to = start.clone().applyQuaternion(new Quaternion().setFromAxisAngle(axis, (degrees * Math.PI) / 180));
      last = unwound(angleBetween(start, to, axis), last);
      expect(last).toBeCloseTo((degrees * Math.PI) / 180, 9);
    }
    expect(unwound(angleBetween(start, new Vector3(0, -1, 0), axis), 0)).toBeCloseTo(-Math.PI / 2, 9);
  });
});

describe("handles", () => {
  it("have distinct names", () => {
    for (const mode of ["move", "turn", "size"] as const) {
      const names = handlesOf(mode, ["x", "y", "z"]).map(keyOf);
      expect(new Set(names).size).toBe(names.length);
    }
    expect(handlesOf("turn", ["z"]).map(keyOf)).toEqual(["ring z"]);
  });

  it("are hit by the distance to their line; of a ring, the front part precedes the rear one", () => {
    expect(toSegment(5, 3, { x: 0, y: 0 }, { x: 10, y: 0 })).toBe(3);
    expect(toSegment(13, 4, { x: 0, y: 0 }, { x: 10, y: 0 })).toBe(5);
    const ring = outline({ kind: "ring", axis: "z" }, HALF).map(({ x, y }) => ({
      x: x * 100,
      y: y * 20,
      depth: y > 0 ? 0.9 : 0.1,
    }));
    const centre = { x: 0, y: 0, depth: 0.5 };
    expect(distanceToOutline(0, -17, ring, centre)).toBeLessThan(1);
    expect(distanceToOutline(0, 17, ring, centre)).toBeGreaterThan(7);
  });

  it("behind the camera cannot be hit", () => {
    expect(distanceToOutline(0, 0, [{ x: 0, y: 0, depth: 1.2 }], { x: 0, y: 0, depth: 1.2 })).toBe(Infinity);
  });
});
