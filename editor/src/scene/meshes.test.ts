import { BoxGeometry } from "three";
import { describe, expect, it } from "vitest";
import { inMetres, likelyUnit, readMesh } from "./meshes";

describe("a mesh that is to be uploaded", () => {
  it("in mm is written in m, and can be read again", async () => {
    const geometry = new BoxGeometry(200, 100, 50);
    const file = inMetres({ file: new File([], "part.obj"), geometry }, 0.001);
    expect(file.name).toBe("part.stl");
    const read = await readMesh(file);
    expect(read.triangles).toBe(12);
    [0.2, 0.1, 0.05].forEach((size, axis) => expect(read.size[axis]).toBeCloseTo(size, 6));
  });

  it("in m stays the file that it is", () => {
    const file = new File(["x"], "part.glb");
    expect(inMetres({ file, geometry: new BoxGeometry() }, 1)).toBe(file);
  });

  it("that is none is refused by its name", async () => {
    await expect(readMesh(new File(["no mesh at all"], "letter.stl"))).rejects.toThrow("letter.stl");
  });

  it("larger than a room is in mm", () =>
    expect([likelyUnit([0.4, 2, 0.1]), likelyUnit([400, 20, 1])]).toEqual(["m", "mm"]));
});
