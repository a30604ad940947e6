import { describe, expect, it } from "vitest";
import { readGlb, readMesh } from "./glb";

/** Write a file like the server's: a triangle per name, those of `coloured` in red. */
function file(names: string[], extras: object, coloured: string[] = []): ArrayBuffer {
  const views: object[] = [];
  const accessors: object[] = [];
  const pieces: Uint8Array[] = [];
  let size = 0;
  const add = (data: Uint8Array, accessor: object, stride?: number) => {
    views.push({ buffer: 0, byteOffset: size, byteLength: data.byteLength, ...(stride && { byteStride: stride }) });
    accessors.push({ bufferView: views.length - 1, ...accessor });
    const padded = new Uint8Array(Math.ceil(data.byteLength / 4) * 4);
    padded.set(data);
    pieces.push(padded);
    size += padded.byteLength;
    return accessors.length - 1;
  };
  const bytes = (array: ArrayBufferView) => new Uint8Array(array.buffer as ArrayBuffer);
  const meshes = names.map((name) => {
    const attributes: Record<string, number> = {
      POSITION: add(bytes(new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 2])), {
        componentType: 5126,
        count: 3,
        type: "VEC3",
      }),
      NORMAL: add(
        bytes(new Int8Array([0, 0, 127, 0, 127, 0, 0, 0, 0, 0, -127, 0])),
        { componentType: 5120, count: 3, type: "VEC3", normalized: true },
        4,
      ),
    };
    if (coloured.includes(name)) {
      const red = new Uint16Array([65535, 0, 0, 65535, 65535, 0, 0, 65535, 65535, 0, 0, 65535]);
      attributes.COLOR_0 = add(bytes(red), { componentType: 5123, count: 3, type: "VEC4", normalized: true });
    }
    const indices = add(bytes(new Uint16Array([0, 1, 2])), { componentType: 5123, count: 3, type: "SCALAR" });
    return { name, primitives: [{ attributes, indices }] };
  });
  const json = JSON.stringify({ scenes: [{ extras }], nodes: [], meshes, accessors, bufferViews: views });
  const text = new TextEncoder().encode(json.padEnd(Math.ceil(json.length / 4) * 4));
  const whole = new Uint8Array(12 + 8 + text.length + 8 + size);
  const head = new DataView(whole.buffer);
  head.setUint32(0, 0x46546c67, true);
  head.setUint32(12, text.length, true);
  whole.set(text, 20);
  let at = 28 + text.length;
  for (const piece of pieces) {
    whole.set(piece, at);
    at += piece.byteLength;
  }
  return whole.buffer;
}

describe("a mesh converted by the server", () => {
  it("has positions, normals, colours and triangles", () => {
    const geometry = readMesh(file(["box.stl"], {}, ["box.stl"]));
    expect([...geometry.getAttribute("position").array]).toEqual([0, 0, 0, 1, 0, 0, 0, 1, 2]);
    const normal = geometry.getAttribute("normal");
    expect([normal.count, normal.getZ(0), normal.getY(0), normal.getX(1)]).toEqual([3, 1, 0, 1]);
    expect(normal.getZ(2)).toBe(-1);
    const colour = geometry.getAttribute("color");
    expect([colour.getX(2), colour.getY(2)]).toEqual([1, 0]);
    expect([...(geometry.index?.array ?? [])]).toEqual([0, 1, 2]);
  });

  it("is refused with a reason if it is invalid", () => {
    expect(() => readGlb(new TextEncoder().encode("solid something that is no glTF").buffer)).toThrow(
      "not a binary glTF",
    );
    expect(() => readMesh(file([], {}))).toThrow("no surface");
  });
});
