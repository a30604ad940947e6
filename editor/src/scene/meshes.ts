/** A mesh before the upload: its size, and its conversion to m. In its own chunk with the loaders. */

import { t } from "@lingui/core/macro";
import type { BufferGeometry } from "three";
import { loadMesh } from "../engine/loaders/mesh";

export interface MeshFile {
  file: File;
  geometry: BufferGeometry;
  triangles: number;
  /** In the unit of the file. */
  size: [number, number, number];
}

/** Read a file; reject with a sentence if it is not a mesh. */
export async function readMesh(file: File): Promise<MeshFile> {
  let geometry: BufferGeometry;
  try {
    geometry = await loadMesh(await file.arrayBuffer(), file.name);
  } catch (error) {
    throw new Error(
      t`${file.name} cannot be read as a mesh: ${error instanceof Error ? error.message : String(error)}`,
    );
  }
  geometry.computeBoundingBox();
  const box = geometry.boundingBox;
  const count = (geometry.index?.count ?? geometry.getAttribute("position").count) / 3;
  const size: [number, number, number] = box
    ? [box.max.x - box.min.x, box.max.y - box.min.y, box.max.z - box.min.z]
    : [0, 0, 0];
  if (count < 1 || !size.every(Number.isFinite) || Math.max(...size) <= 0)
    throw new Error(t`${file.name} contains no surface.`);
  return { file, geometry, triangles: Math.floor(count), size };
}

/** Return the unit that gives the mesh a plausible size. */
export function likelyUnit(size: readonly number[]): "m" | "mm" {
  return Math.max(...size) > 5 ? "mm" : "m";
}

/** Return the mesh in m as a binary STL; the original file if it is in m. */
export function inMetres({ file, geometry }: Pick<MeshFile, "file" | "geometry">, metresPerUnit: number): File {
  if (metresPerUnit === 1) return file;
  const flat = geometry.index ? geometry.toNonIndexed() : geometry;
  const position = flat.getAttribute("position");
  const triangles = Math.floor(position.count / 3);
  const view = new DataView(new ArrayBuffer(84 + triangles * 50));
  view.setUint32(80, triangles, true);
  for (let n = 0; n < triangles; n++) {
    const at = 84 + n * 50 + 12; // readers compute the normals
    for (let corner = 0; corner < 3; corner++) {
      const from = n * 3 + corner;
      [position.getX(from), position.getY(from), position.getZ(from)].forEach((value, axis) => {
        view.setFloat32(at + corner * 12 + axis * 4, value * metresPerUnit, true);
      });
    }
  }
  return new File([view.buffer], `${file.name.replace(/\.\w+$/, "")}.stl`, { type: "model/stl" });
}
