import { BoxGeometry } from "three";
import { describe, expect, it } from "vitest";
import { inMetres, likelyUnit, readMesh } from "./meshes";

describe("a mesh before the upload", () => {
  it("in mm is converted to m and can be read again", async () => {
    const geometry = new BoxGeometry(200, 100, 50);
    const file = inMetres({ file: new File([], "part.obj"), geometry }, 0.001);
    expect(file.name).toBe("part.stl");
    const read = await readMesh(file);
    expect(read.triangles).toBe(12);
    [0.2, 0.1, 0.05].forEach((size, axis) => expect(read.size[axis]).toBeCloseTo(size, 6));
  });

  it("in m is uploaded unchanged", () => {
    const file = new File(["x"], "part.glb");
    expect(inMetres({ file, geometry: new BoxGeometry() }, 1)).toBe(file);
  });

  it("is refused with its name if it cannot be read", async () => {
    await expect(readMesh(new File(["no mesh at all"], "letter.stl"))).rejects.toThrow("letter.stl");
  });

  it("is assumed to be in mm if it would be implausibly large in m", () =>
    expect([likelyUnit([0.4, 2, 0.1]), likelyUnit([400, 20, 1])]).toEqual(["m", "mm"]));
});
